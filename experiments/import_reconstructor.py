"""Turn published weights of DepthSplat or Depth-Anything-V2 ViT-S into weights of `reconstruct=depthsplat`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import jax
from rich.console import Console

from aerojax.core.config import to_mapping
from aerojax.core.files import sha256_of_file, write_json
from aerojax.core.provenance import commit
from aerojax.reconstruct.depthsplat.config import DepthSplatConfig
from aerojax.reconstruct.depthsplat.released import import_depthsplat
from aerojax.reconstruct.weights import save_reconstructor
from experiments._launch.command import Run, experiment


@dataclass(frozen=True, kw_only=True)
class Config:
    """The file, the geometry to use its weights with, and where ours go.

    checkpoint: safetensors or a file of `torch.save`. out: the weights to write.
    reconstruct: the member; upstream's weights were trained with `compat=true`, and with depths of their own.
    seed: of what the file does not hold.
    """

    preset: str
    checkpoint: Path = field(metadata={"given": True})
    out: Path
    reconstruct: DepthSplatConfig = field(default_factory=DepthSplatConfig)
    seed: int = 0


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Checkpoint in, safetensors out."""
    imported = import_depthsplat(config.checkpoint, config.reconstruct, key=jax.random.key(config.seed))
    origin = {"file": config.checkpoint.name, "sha256": sha256_of_file(config.checkpoint), "commit": commit()}
    record = {"imported": origin | {"kind": imported.kind}}
    save_reconstructor(config.out, imported.reconstructor, replace(imported.config, weights=""), record)
    found = {"config": to_mapping(imported.config), "kind": imported.kind, "unused": imported.unused}
    write_json(run.directory / "metrics.json", {"weights": str(config.out), **origin, **found})
    console, sizes = Console(), imported.config
    whole = "encoder" if imported.kind == "encoder" else "monocular branch; the rest is random"
    console.print(f"{config.out}: {whole}, {sizes.candidates} candidates", soft_wrap=True)
    console.print(f"{len(imported.unused)} stored tensors without use: {', '.join(imported.unused)}", soft_wrap=True)


if __name__ == "__main__":
    main()
