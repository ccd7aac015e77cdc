"""MSR-Action3D's depth recordings or skeletons of 20 actions, as clips of points for the classifiers."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from aerojax.data.imports.msr_action import ActionReading, find_recordings, import_recordings
from experiments._launch.command import Run, experiment
from experiments._launch.imported_clips import tell
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config:
    """Where the recordings are, how they become clips, and where those go.

    source: folder of *_sdepth.bin or *_skeleton3D.txt, at any depth.
    out: folder of the clips. reading: kind, points and validation. seed: of the points that are drawn.
    """

    preset: str
    seed: int = 0
    source: Path = field(metadata={"given": True})
    out: Path
    reading: ActionReading = field(default_factory=ActionReading)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Write the clips that are missing, `<out>/<split>/<recording>.npz`; then name every file that was unreadable."""
    recordings = find_recordings(config.source, config.reading)
    with progress_bar("clips/s") as bar:
        made = import_recordings(
            recordings, config.reading, config.out, source=config.source, seed=config.seed, progress=shown_in(bar)
        )
    tell(made, config.out, run, what="recordings")


if __name__ == "__main__":
    main()
