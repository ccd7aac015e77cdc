"""Sequences of Gaussians that another code reconstructed, or the released data set, as clips."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax

from aerojax.core.claims import claim
from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.seeds import number_of
from aerojax.data.clips import RECORD, save_clip
from aerojax.data.imports.released_frames import FrameReading, read_sequence
from aerojax.data.imports.released_layout import FrameSequence


@dataclass(frozen=True)
class ImportedClips:
    """What a run left: the number of clips by split, and what was wrong with each sequence that left none."""

    counts: dict[str, int]
    problems: tuple[str, ...]


def import_sequences(
    sequences: Sequence[FrameSequence],
    reading: FrameReading,
    folder: Path,
    *,
    source: Path,
    seed: int,
    progress: Callable[[int, int, str], None],
) -> ImportedClips:
    """Write the clips that are missing, `<folder>/<split>/<sequence>.npz`.

    Args:
        sequences: of `find_sequences(source)`.
        reading: how files become frames.
        folder: of the clips.
        source: where the frames are; noted with the clips.
        seed: of the decimation.
        progress: called after each sequence with (done, total, what).

    Raises:
        UserError: the folder holds clips of another source or configuration.
    """
    # Not under `pipeline`, whose settings go into trained weights: the reconstruction was somebody else's.
    claim(folder / RECORD, {"imported": {"source": str(source), "seed": seed, "reading": to_mapping(reading)}})
    counts, problems = Counter[str](), []
    for done, sequence in enumerate(sequences, start=1):
        path = folder / sequence.split / f"{sequence.name}.npz"
        try:
            if not path.exists():
                key = jax.random.key(number_of(seed, sequence.name) % 2**31)
                save_clip(path, read_sequence(sequence, reading, key=key), sequence.label, sequence.identity)
            counts[sequence.split] += 1
        except UserError as error:
            problems.append(str(error))
        progress(done, len(sequences), f"clips in {folder}")
    return ImportedClips(dict(counts), tuple(problems))
