"""Sequences of Gaussians from other reconstructions, or the released data set, as clips for the classifier."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from aerojax.data.imports.released_clips import import_sequences
from aerojax.data.imports.released_frames import FrameReading
from aerojax.data.imports.released_layout import find_sequences
from aerojax.data.splits import Split
from aerojax.gaussians.decimate import DecimationConfig
from experiments._launch.command import Run, experiment
from experiments._launch.imported_clips import tell
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config:
    """Where the frames are, what their paths do not say, and where the clips go.

    source: folder of frames. out: folder of the clips.
    label, split: of every sequence; folders on the way say it if null.
    version: which of a preprocessed frame's random subsets.
    tokens: kept of a frame; all clips of a training need the same.
    decimation: of frames that are not preprocessed; seed: of that.
    """

    preset: str
    seed: int = 0
    source: Path = field(metadata={"given": True})
    out: Path
    label: str | None = None
    split: Split | None = None
    version: int = 0
    tokens: int = 512
    decimation: DecimationConfig = field(default_factory=DecimationConfig)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Write the clips that are missing, `<out>/<split>/<sequence>.npz`; then name every file that was unreadable."""
    reading = FrameReading(config.version, config.tokens, config.decimation)
    sequences = find_sequences(config.source, label=config.label, split=config.split)
    with progress_bar("clips/s") as bar:
        made = import_sequences(
            sequences, reading, config.out, source=config.source, seed=config.seed, progress=shown_in(bar)
        )
    tell(made, config.out, run, what="sequences")


if __name__ == "__main__":
    main()
