"""Sequences of Gaussians that another code reconstructed, or the released data set, as clips."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import jax
import numpy as np

from aerojax.core.seeds import number_of
from aerojax.data.imports.each_clip import ImportedClips, import_each
from aerojax.data.imports.released_frames import FrameReading, read_sequence
from aerojax.data.imports.released_layout import FrameSequence


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

    def columns(sequence: FrameSequence) -> np.ndarray:
        return read_sequence(sequence, reading, key=jax.random.key(number_of(seed, sequence.name) % 2**31))

    return import_each(sequences, columns, reading, folder, source=source, seed=seed, progress=progress)
