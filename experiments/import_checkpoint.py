"""Turn a checkpoint of the released PyTorch code into weights that every experiment here reads."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from aerojax.classify.released.checkpoint import import_checkpoint
from aerojax.classify.weights import save_weights
from aerojax.core.config import to_mapping
from experiments._launch.command import Run, experiment, provenance, write_json


@dataclass(frozen=True)
class Config:
    """The checkpoint, what it does not say, and where the weights go.

    heads: of the attention; the shapes hold only heads times width.
    tokens, frames: of a frame and of a clip in training.
    """

    preset: str
    checkpoint: Path
    out: Path
    heads: int
    tokens: int
    frames: int


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Checkpoint in, safetensors out."""
    imported = import_checkpoint(config.checkpoint, heads=config.heads)
    digest = hashlib.sha256(config.checkpoint.read_bytes()).hexdigest()
    origin = {"file": config.checkpoint.name, "sha256": digest, "commit": provenance()["commit"]}
    notes = {"reading": {"tokens": config.tokens, "frames": config.frames}, "imported": origin}
    config.out.parent.mkdir(parents=True, exist_ok=True)
    save_weights(config.out, imported.model, metadata={name: json.dumps(value) for name, value in notes.items()})
    found = {"config": to_mapping(imported.model.config), "unused": imported.unused}
    write_json(run.directory / "metrics.json", {"weights": str(config.out), **origin, **found})
    kind = imported.model.config
    console = Console()
    console.print(f"{config.out}: mode {kind.mode}, width {kind.d_model}, {kind.mamba_layers} layers", soft_wrap=True)
    console.print(f"{len(imported.unused)} stored tensors without use: {', '.join(imported.unused)}", soft_wrap=True)


if __name__ == "__main__":
    main()
