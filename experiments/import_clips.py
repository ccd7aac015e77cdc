"""Sequences of Gaussians from other reconstructions, or the released data set, as clips for the classifier."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import jax
from rich.console import Console

from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.imports.released_frames import FrameReading, read_sequence
from aerojax.data.imports.released_layout import Split, find_sequences
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.pipeline.clips import MANIFEST
from aerojax.simulate.plan.single import sequence_seed
from aerojax.training.variation import save_clip
from experiments._launch.command import Run, experiment, write_json
from experiments._launch.progress import progress_bar


@dataclass(frozen=True)
class Config:
    """Where the frames are, what their paths do not say, and where the clips go.

    label, split: of every sequence; folders on the way say it if null.
    version: which of a preprocessed frame's random subsets.
    tokens: kept of a frame.
    """

    preset: str
    seed: int
    source: Path
    out: Path
    label: str | None
    split: Split | None
    version: int
    tokens: int
    decimation: DecimationConfig


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Write the clips that are missing, `<out>/<split>/<sequence>.npz`; then name every file that was unreadable."""
    if config.label not in (None, *CLASSES):
        raise UserError("out-of-range", f"label {config.label!r} is no class", f"choose one of {', '.join(CLASSES)}")
    if config.version < 0 or config.tokens < 1:
        raise UserError(
            "out-of-range",
            f"version {config.version} must be at least 0 and tokens {config.tokens} at least 1",
            "correct them",
        )
    reading = FrameReading(config.version, config.tokens, config.decimation)
    sequences = find_sequences(config.source, label=config.label, split=config.split)
    # Notes of the reconstruction go into trained weights; here it was somebody else's.
    origin = {"source": str(config.source), "seed": config.seed, "reading": to_mapping(reading)}
    manifest, path = {"pipeline": {"imported": origin}}, config.out / MANIFEST
    if path.is_file() and json.loads(path.read_text()) != manifest:
        raise UserError(
            "invalid", f"{path}: out holds clips of another source or configuration", "choose another folder"
        )
    config.out.mkdir(parents=True, exist_ok=True)
    write_json(path, manifest)
    counts, problems = Counter[str](), list[str]()
    with progress_bar("clips/s") as bar:
        task = bar.add_task(f"clips in {config.out}", total=len(sequences))
        for sequence in sequences:
            path = config.out / sequence.split / f"{sequence.name}.npz"
            key = jax.random.key(sequence_seed(config.seed, sequence.name) % 2**31)
            try:
                if not path.exists():
                    save_clip(path, read_sequence(sequence, reading, key=key), sequence.label, sequence.identity)
                counts[sequence.split] += 1
            except UserError as error:
                problems.append(str(error))
            bar.advance(task)
    write_json(run.directory / "metrics.json", {"folder": str(config.out), "clips": counts, "problems": problems})
    Console().print(f"{config.out}: {dict(counts)}", soft_wrap=True)
    if problems:
        raise UserError(
            "invalid", "some sequences left no clip; mend the files and run again:\n  " + "\n  ".join(problems)
        )


if __name__ == "__main__":
    main()
