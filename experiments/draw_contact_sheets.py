"""Draw one sheet a class that shows every identity in two poses, with its name and split."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.splits import SPLITS, Split
from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.render.contact_sheet import SheetConfig, arrange_cells, sheet_cell, write_jpeg
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """Whose sheets are drawn, and where they go.

    out: folder of the sheets, <class>.jpg; the run's directory if None. assets: USD stages of the identities.
    splits: whose identities are drawn. labels: only these classes. sheet: its cells.
    """

    preset: str
    out: Path | None = None
    assets: Path = Path("data/assets")
    splits: tuple[Split, ...] = SPLITS
    labels: tuple[str, ...] = CLASSES
    sheet: SheetConfig = field(default_factory=SheetConfig)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Write `<label>.jpg` for every class."""
    folder = config.out or run.directory
    folder.mkdir(parents=True, exist_ok=True)
    everyone = [i for split in config.splits for i in identities(split)]
    with progress_bar() as bar:
        task = bar.add_task("identities", total=len(everyone))
        for label in config.labels:
            cells = []
            for identity in (i for i in everyone if i.label == label):
                cells.append(sheet_cell(identity, config.assets, config.sheet))
                bar.advance(task)
            if not cells:
                raise UserError(
                    "invalid", f"labels: no identity of class {label!r}", "choose of bird, drone, airplane, helicopter"
                )
            image = arrange_cells(cells, config.sheet.columns)
            size = write_jpeg(folder / f"{label}.jpg", image, config.sheet.largest_bytes)
            Console().print(f"{folder / label}.jpg: {len(cells)} identities, {size // 1000} kB", soft_wrap=True)


if __name__ == "__main__":
    main()
