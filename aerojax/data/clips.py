"""Clips: labelled sequences of Gaussians, one `.npz` each on disk, padded to one length in memory."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32, Int

from aerojax.core.errors import UserError
from aerojax.core.files import whole_file
from aerojax.core.types import CLASSES

RECORD = "manifest.json"
"""Where a folder of clips notes how they were made; see `core.claims`."""


@dataclass(frozen=True)
class ClipSet:
    """Labelled clips, padded to one length: columns (14 attributes), which frames are real, labels, identities."""

    columns: Float32[np.ndarray, "clip time token 14"]
    present: Bool[np.ndarray, "clip time"]
    label: Int[np.ndarray, "clip"]
    identity: tuple[str, ...]


def save_clip(path: Path, columns: np.ndarray, label: str, identity: str) -> None:
    """Write one clip as `.npz`, whole or not at all.

    Args:
        path: of the file; folders are made.
        columns: (time, token, 14), see `core.types.Gaussians.columns`; absent frames are left out.
        label: a name of `CLASSES`.
        identity: name of the individual.
    """
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, columns=columns.astype(np.float32), label=np.array(label), identity=np.array(identity))


def clip_files(folder: Path) -> list[Path]:
    """The clips of a folder in the order of names; what a killed writer left is none."""
    return sorted(path for path in folder.glob("*.npz") if not path.name.startswith("."))


def load_clips(folder: Path, *, frames: int) -> ClipSet:
    """Read every clip of a folder in the order of names, padded with zeros or cut to `frames`.

    Raises:
        UserError: no clips, or one that is broken, of another class or of another size.
    """
    paths = clip_files(folder)
    if not paths:
        raise UserError(
            "missing", f"{folder} holds no clips (*.npz)", "make them with python -m experiments.reconstruct_dataset"
        )
    columns, present, labels, identities = [], [], [], []
    for path in paths:
        clip, label, identity = _load_clip(path)
        clip = clip[:frames]
        if columns and clip.shape[1] != columns[0].shape[1]:
            raise UserError(
                "mismatch",
                f"{path} has {clip.shape[1]} tokens a frame, others have {columns[0].shape[1]}",
                "make it again",
            )
        padding = frames - len(clip)
        columns.append(np.pad(clip, ((0, padding), (0, 0), (0, 0))))
        present.append(np.arange(frames) < len(clip))
        labels.append(CLASSES.index(label))
        identities.append(identity)
    return ClipSet(np.stack(columns), np.stack(present), np.array(labels), tuple(identities))


def join_clips(sets: Sequence[ClipSet]) -> ClipSet:
    """Several sets of equal length as one, in order.

    Raises:
        UserError: they have different numbers of tokens a frame.
    """
    tokens = {clips.columns.shape[2] for clips in sets}
    if len(tokens) > 1:
        raise UserError(
            "mismatch", f"sets of clips have {sorted(tokens)} tokens a frame", "make them again with one number"
        )
    return ClipSet(
        np.concatenate([clips.columns for clips in sets]),
        np.concatenate([clips.present for clips in sets]),
        np.concatenate([clips.label for clips in sets]),
        tuple(name for clips in sets for name in clips.identity),
    )


def _load_clip(path: Path) -> tuple[Float32[np.ndarray, "time token 14"], str, str]:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            clip, label, identity = stored["columns"], str(stored["label"]), str(stored["identity"])
    except (OSError, EOFError, ValueError, KeyError, AttributeError, zipfile.BadZipFile) as error:
        raise UserError(
            "unreadable", f"{path} cannot be read as a clip ({error})", "delete it and make it again"
        ) from None
    if label not in CLASSES or clip.ndim != 3 or clip.shape[-1] != 14:
        raise UserError(
            "unreadable", f"{path} is not a clip of (time, token, 14) with a class of {CLASSES}", "make it again"
        )
    return clip.astype(np.float32), label, identity
