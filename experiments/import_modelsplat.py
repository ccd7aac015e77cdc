"""ModelNet's objects as Gaussians (ModelSplat-10 or -40), as clips of single frames for the classifiers."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from aerojax.data.imports.modelsplat import ObjectReading, find_objects, import_objects
from experiments._launch.command import Run, experiment
from experiments._launch.imported_clips import tell
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config:
    """Where the objects are, how they become clips, and where those go.

    source: folder with a folder a class, as ShapeSplat's ModelSplat is unpacked.
    lists: folder of the official lists modelnet10_train.txt and so on; null takes whatever is in the folders.
    out: folder of the clips. reading: subset, versions and decimation. seed: of the decimation.
    """

    preset: str
    seed: int = 0
    source: Path = field(metadata={"given": True})
    lists: Path | None = None
    out: Path
    reading: ObjectReading = field(default_factory=ObjectReading)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Write the clips that are missing, `<out>/<split>/<object>.npz`; then name every file that was unreadable."""
    objects = find_objects(config.source, config.reading, lists=config.lists)
    with progress_bar("clips/s") as bar:
        made = import_objects(
            objects, config.reading, config.out, source=config.source, seed=config.seed, progress=shown_in(bar)
        )
    tell(made, config.out, run, what="objects")


if __name__ == "__main__":
    main()
