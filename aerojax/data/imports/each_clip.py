"""Clips written from what others recorded or reconstructed: the same loop whatever they are read from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from aerojax.core.claims import claim
from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.clips import RECORD, save_clip


@runtime_checkable
class ClipSource(Protocol):
    """One clip to be: its name, class, individual and split."""

    @property
    def name(self) -> str:
        """Of the clip, and of its file."""
        ...

    @property
    def label(self) -> str:
        """Its class."""
        ...

    @property
    def identity(self) -> str:
        """The individual that it shows."""
        ...

    @property
    def split(self) -> str:
        """Of the data set."""
        ...


_S = TypeVar("_S", bound=ClipSource)


@dataclass(frozen=True)
class ImportedClips:
    """What a run left: the number of clips by split, and what was wrong with each source that left none."""

    counts: dict[str, int]
    problems: tuple[str, ...]


def import_each(
    sources: Sequence[_S],
    columns_of: Callable[[_S], np.ndarray],
    reading: Any,
    folder: Path,
    *,
    source: Path,
    seed: int,
    progress: Callable[[int, int, str], None],
    classes: tuple[str, ...] = CLASSES,
) -> ImportedClips:
    """Write the clips that are missing, `<folder>/<split>/<name>.npz`.

    Args:
        sources: of the clips.
        columns_of: a source's Gaussians, (time, token, 14); a `UserError` is noted, and the others are still read.
        reading: configuration of how files become clips; noted with the clips, as `source` and `seed` are.
        folder: of the clips.
        source: where the files are.
        seed: of what is drawn.
        progress: called after each source with (done, total, what).
        classes: that the labels are of.

    Raises:
        UserError: the folder holds clips of another source or configuration.
    """
    # Not under `pipeline`, whose settings go into trained weights: the reconstruction was somebody else's.
    claim(folder / RECORD, {"imported": {"source": str(source), "seed": seed, "reading": to_mapping(reading)}})
    counts, problems = Counter[str](), []
    for done, one in enumerate(sources, start=1):
        path = folder / one.split / f"{one.name}.npz"
        try:
            if not path.exists():
                save_clip(path, columns_of(one), one.label, one.identity, classes=classes)
            counts[one.split] += 1
        except UserError as error:
            problems.append(str(error))
        progress(done, len(sources), f"clips in {folder}")
    return ImportedClips(dict(counts), tuple(problems))
