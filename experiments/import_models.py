"""Convert users' own models and draw them, to see that they are upright, whole and animated before they fly."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from aerojax.core.files import write_json
from aerojax.simulate.assets.catalogue import build_identity
from aerojax.simulate.assets.importers.identities import imported_identities
from aerojax.simulate.render.contact_sheet import SheetConfig, arrange_cells, sheet_cell, write_jpeg
from aerojax.simulate.usd.animated_mesh import load_animated_mesh
from experiments._launch.command import Run, experiment


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which models, where their stages go, and how they are drawn.

    models: the list, YAML: name, file, class, axes …; see `aerojax.simulate.assets.importers`.
    assets: where the stages and pictures go. out: folder of models.jpg; the run's directory if None.
    """

    preset: str
    models: Path = field(metadata={"given": True})
    assets: Path = Path("data/assets")
    out: Path | None = None
    sheet: SheetConfig = field(default_factory=lambda: SheetConfig(largest_bytes=2_000_000))


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Write every model's stage, `models.jpg` with two poses of each, and what was measured."""
    folder = config.out or run.directory
    folder.mkdir(parents=True, exist_ok=True)
    table = Table("model", "class", "split", "length, width, height (m)", "faces", "cycle (s)")
    cells, found = [], {}
    for identity in imported_identities(config.models):
        mesh = load_animated_mesh(build_identity(identity, config.assets))
        size = np.ptp(mesh.vertices_at(0.0), axis=0).astype(float).round(3).tolist()
        found[identity.name] = {"size_m": size, "faces": len(mesh.faces), "cycle_seconds": mesh.cycle_seconds}
        words = (", ".join(f"{v:.3f}" for v in size), str(len(mesh.faces)), f"{mesh.cycle_seconds:.3f}")
        table.add_row(identity.name, identity.label, identity.split, *words)
        cells.append(sheet_cell(identity, config.assets, config.sheet))
    if cells:
        write_jpeg(folder / "models.jpg", arrange_cells(cells, config.sheet.columns), config.sheet.largest_bytes)
    write_json(run.directory / "metrics.json", found)
    Console().print(table)
    Console().print(
        f"{folder / 'models.jpg'}: {len(cells)} models; their stages are in {config.assets}", soft_wrap=True
    )


if __name__ == "__main__":
    main()
