"""Turn a checkpoint of the released PyTorch code into weights that every experiment here reads."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

from rich.console import Console

from aerojax.classify.base import untrained_card
from aerojax.classify.load import save_classifier
from aerojax.classify.mambasplat.classifier import MambaSplatClassifier
from aerojax.classify.released.checkpoint import import_checkpoint
from aerojax.core.config import to_mapping
from aerojax.core.files import sha256_of_file, write_json
from aerojax.core.provenance import commit
from experiments._launch.command import Run, experiment


@dataclass(frozen=True, kw_only=True)
class Config:
    """The checkpoint, what it does not say, and where the weights go.

    checkpoint: a `.pt` file of the published code. out: the weights to write, `.safetensors`.
    heads: of the attention; the shapes hold only heads times width.
    tokens, frames: of a frame and of a clip in training.
    """

    preset: str
    checkpoint: Path = field(metadata={"given": True})
    out: Path
    heads: int = 4
    tokens: int = 512
    frames: int = 16


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Checkpoint in, safetensors out."""
    imported = import_checkpoint(config.checkpoint, heads=config.heads)
    digest = sha256_of_file(config.checkpoint)
    origin = {"file": config.checkpoint.name, "sha256": digest, "commit": commit()}
    card = untrained_card(imported.model.config, tokens=config.tokens, frames=config.frames)
    card = replace(card, record=json.dumps({"imported": origin}))
    save_classifier(config.out, MambaSplatClassifier(imported.model, card))
    found = {"config": to_mapping(imported.model.config), "unused": imported.unused}
    write_json(run.directory / "metrics.json", {"weights": str(config.out), **origin, **found})
    kind = imported.model.config
    console = Console()
    console.print(f"{config.out}: mode {kind.mode}, width {kind.d_model}, {kind.mamba_layers} layers", soft_wrap=True)
    console.print(f"{len(imported.unused)} stored tensors without use: {', '.join(imported.unused)}", soft_wrap=True)


if __name__ == "__main__":
    main()
