"""Clips: labelled sequences of Gaussians and crops, one `.npz` each on disk, padded to one length in memory."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32, Int, UInt8

from aerojax.core.errors import UserError
from aerojax.core.files import whole_file
from aerojax.core.types import CLASSES

RECORD = "manifest.json"
"""Where a folder of clips notes how they were made; see `core.claims`."""


VIEWS = 8
"""Views of a frame that are kept in memory, the first ones; fewer are padded with views that do not count."""

Fact = str | int | float | bool


@dataclass(frozen=True)
class ClipSet:
    """Labelled clips, padded to one length.

    columns: the 14 attributes of `core.types.Gaussians.columns`.
    present: which frames are real.
    label: index into `CLASSES`. identity: name of the individual.
    crops: of `core.types.Crops`, 255 for 1; None where no clip has any.
    crop_valid: views that count; False throughout for clips without crops.
    facts: of each clip, what is known of how it came about (see `save_clip`).
    """

    columns: Float32[np.ndarray, "clip time token 14"]
    present: Bool[np.ndarray, "clip time"]
    label: Int[np.ndarray, "clip"]
    identity: tuple[str, ...]
    crops: UInt8[np.ndarray, "clip time view size size 4"] | None = None
    crop_valid: Bool[np.ndarray, "clip time view"] | None = None
    facts: tuple[Mapping[str, Fact], ...] = ()

    def take(self, index: np.ndarray | slice) -> ClipSet:
        """Some of the clips."""
        chosen = np.arange(len(self.label))[index]
        return ClipSet(
            self.columns[chosen],
            self.present[chosen],
            self.label[chosen],
            tuple(self.identity[i] for i in chosen),
            None if self.crops is None else self.crops[chosen],
            None if self.crop_valid is None else self.crop_valid[chosen],
            tuple(self.facts[i] for i in chosen) if self.facts else (),
        )


@dataclass(frozen=True, eq=False)
class StoredClip:
    """One clip as it lies on disk: absent frames are left out, views are as many as the cameras."""

    columns: Float32[np.ndarray, "time token 14"]
    label: str
    identity: str
    crops: UInt8[np.ndarray, "time view size size 4"] | None = None
    crop_valid: Bool[np.ndarray, "time view"] | None = None
    facts: Mapping[str, Fact] = field(default_factory=dict)


def crop_bytes(rgba: Float32[np.ndarray, "*batch 4"]) -> UInt8[np.ndarray, "*batch 4"]:
    """Crops of 0..1 as they are stored."""
    return np.rint(rgba * 255.0).astype(np.uint8)


def save_clip(
    path: Path,
    columns: np.ndarray,
    label: str,
    identity: str,
    *,
    crops: np.ndarray | None = None,
    crop_valid: np.ndarray | None = None,
    facts: Mapping[str, Fact] | None = None,
) -> None:
    """Write one clip as `.npz`, whole or not at all.

    Args:
        path: of the file; folders are made.
        columns: (time, token, 14), see `core.types.Gaussians.columns`; absent frames are left out.
        label: a name of `CLASSES`.
        identity: name of the individual.
        crops: (time, view, size, size, 4), see `crop_bytes`.
        crop_valid: (time, view), views that count; given with `crops`.
        facts: what is known of the clip, such as rig, cameras, width_px (median of the object's longer side in the
            images), distance_m.
    """
    arrays = {"columns": columns.astype(np.float32), "label": np.array(label), "identity": np.array(identity)}
    if crops is not None and crop_valid is not None:
        arrays |= {"crops": crops.astype(np.uint8), "crop_valid": crop_valid.astype(bool)}
    if facts:
        arrays["facts"] = np.array(json.dumps(dict(facts), sort_keys=True))
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)


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
            "missing",
            f"{folder} holds no clips (*.npz)",
            "make them with python -m experiments.generate_clips or experiments.reconstruct_dataset",
        )
    clips = [load_clip(path) for path in paths]
    tokens = clips[0].columns.shape[1]
    size = next((found for found in map(_crop_size, clips) if found), 0)
    for path, clip in zip(paths, clips, strict=True):
        if clip.columns.shape[1] != tokens:
            problem = f"{path} has {clip.columns.shape[1]} tokens a frame, others have {tokens}"
            raise UserError("mismatch", problem, "make it again")
        if _crop_size(clip) not in (0, size):
            problem = f"{path} has crops of {_crop_size(clip)} pixels, others of {size}"
            raise UserError("mismatch", problem, "make it again")
    return pack_clips(clips, frames=frames)


def pack_clips(clips: Sequence[StoredClip], *, frames: int) -> ClipSet:
    """Clips in memory, in order, padded with zeros or cut to `frames` and to `VIEWS` views."""
    tokens, size = clips[0].columns.shape[1], max(map(_crop_size, clips))
    columns = np.zeros((len(clips), frames, tokens, 14), np.float32)
    present = np.zeros((len(clips), frames), bool)
    crops = np.zeros((len(clips), frames, VIEWS, size, size, 4), np.uint8) if size else None
    valid = np.zeros((len(clips), frames, VIEWS), bool) if size else None
    for index, clip in enumerate(clips):
        length = min(len(clip.columns), frames)
        columns[index, :length], present[index, :length] = clip.columns[:length], True
        if crops is not None and valid is not None and clip.crops is not None and clip.crop_valid is not None:
            views = min(clip.crops.shape[1], VIEWS)
            crops[index, :length, :views] = clip.crops[:length, :views]
            valid[index, :length, :views] = clip.crop_valid[:length, :views]
    labels = np.array([CLASSES.index(clip.label) for clip in clips])
    facts = tuple(clip.facts for clip in clips)
    return ClipSet(columns, present, labels, tuple(clip.identity for clip in clips), crops, valid, facts)


def _crop_size(clip: StoredClip) -> int:
    return 0 if clip.crops is None else clip.crops.shape[2]


def join_clips(sets: Sequence[ClipSet]) -> ClipSet:
    """Several sets of equal length as one, in order.

    Raises:
        UserError: they have different numbers of tokens a frame, or crops of different sizes.
    """
    tokens = {clips.columns.shape[2] for clips in sets}
    sizes = {clips.crops.shape[3] for clips in sets if clips.crops is not None}
    for name, found in (("tokens a frame", tokens), ("pixels a crop", sizes)):
        if len(found) > 1:
            raise UserError("mismatch", f"sets of clips have {sorted(found)} {name}", "make them again with one number")
    size = max(sizes, default=0)
    return ClipSet(
        np.concatenate([clips.columns for clips in sets]),
        np.concatenate([clips.present for clips in sets]),
        np.concatenate([clips.label for clips in sets]),
        tuple(name for clips in sets for name in clips.identity),
        np.concatenate([_crops_of(clips, size)[0] for clips in sets]) if size else None,
        np.concatenate([_crops_of(clips, size)[1] for clips in sets]) if size else None,
        tuple(facts for clips in sets for facts in (clips.facts or ({},) * len(clips.label))),
    )


def _crops_of(clips: ClipSet, size: int) -> tuple[np.ndarray, np.ndarray]:
    if clips.crops is not None and clips.crop_valid is not None:
        return clips.crops, clips.crop_valid
    shape = (*clips.present.shape, VIEWS)
    return np.zeros((*shape, size, size, 4), np.uint8), np.zeros(shape, bool)


def load_clip(path: Path) -> StoredClip:
    """Read one clip.

    Raises:
        UserError: it is broken, of no class or of another layout.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        clip = arrays["columns"].astype(np.float32)
        label, identity = str(arrays["label"]), str(arrays["identity"])
        facts = json.loads(str(arrays["facts"])) if "facts" in arrays else {}
    except (OSError, EOFError, ValueError, KeyError, AttributeError, zipfile.BadZipFile) as error:
        raise UserError(
            "unreadable", f"{path} cannot be read as a clip ({error})", "delete it and make it again"
        ) from None
    crops, valid = arrays.get("crops"), arrays.get("crop_valid")
    fits = label in CLASSES and clip.ndim == 3 and clip.shape[-1] == 14 and isinstance(facts, dict)
    if crops is not None or valid is not None:
        fits = fits and _crops_fit(crops, valid, clip)
    if not fits:
        raise UserError(
            "unreadable",
            f"{path} is not a clip of (time, token, 14), with or without crops, with a class of {CLASSES}",
            "make it again",
        )
    return StoredClip(clip, label, identity, crops, valid, facts)


def _crops_fit(crops: np.ndarray | None, valid: np.ndarray | None, columns: np.ndarray) -> bool:
    if crops is None or valid is None or crops.dtype != np.uint8 or valid.dtype != bool or crops.ndim != 5:
        return False
    square = crops.shape[2] == crops.shape[3] > 0 and crops.shape[4] == 4
    return square and valid.shape == crops.shape[:2] and len(valid) == len(columns)
