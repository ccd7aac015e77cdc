"""Clips: labelled sequences of Gaussians and crops, one `.npz` each on disk, padded to one length in memory."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
    label: index into `classes`. identity: name of the individual.
    crops: of `core.types.Crops`, 255 for 1; None where no clip has any.
    crop_valid: views that count; False throughout for clips without crops.
    facts: of each clip, what is known of how it came about (see `save_clip`).
    classes: names of what the clips show; those of this project unless they come from another data set.
    """

    columns: Float32[np.ndarray, "clip time token 14"]
    present: Bool[np.ndarray, "clip time"]
    label: Int[np.ndarray, "clip"]
    identity: tuple[str, ...]
    crops: UInt8[np.ndarray, "clip time view size size 4"] | None = None
    crop_valid: Bool[np.ndarray, "clip time view"] | None = None
    facts: tuple[Mapping[str, Fact], ...] = ()
    classes: tuple[str, ...] = CLASSES

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
            self.classes,
        )


@dataclass(frozen=True, eq=False)
class StoredClip:
    """One clip as it lies on disk: absent frames are left out, views are as many as the cameras.

    label: a name of `classes`.
    """

    columns: Float32[np.ndarray, "time token 14"]
    label: str
    identity: str
    crops: UInt8[np.ndarray, "time view size size 4"] | None = None
    crop_valid: Bool[np.ndarray, "time view"] | None = None
    facts: Mapping[str, Fact] = field(default_factory=dict)
    classes: tuple[str, ...] = CLASSES

    def seen_by(self, cameras: int, *, seed: int) -> StoredClip:
        """With crops of so many cameras alone, drawn among those that count in any frame; Gaussians stay as they are.

        Raises:
            UserError: there are no crops.
        """
        if self.crop_valid is None:
            raise UserError("missing", f"a clip of {self.identity} has no crops to choose among", "make it again")
        used = np.flatnonzero(self.crop_valid.any(axis=0))
        chosen = np.random.default_rng(seed).permutation(used)[:cameras]
        kept = np.isin(np.arange(self.crop_valid.shape[1]), chosen)
        return replace(self, crop_valid=self.crop_valid & kept)


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
    classes: tuple[str, ...] = CLASSES,
) -> None:
    """Write one clip as `.npz`, whole or not at all.

    Args:
        path: of the file; folders are made.
        columns: (time, token, 14), see `core.types.Gaussians.columns`; absent frames are left out.
        label: a name of `classes`.
        identity: name of the individual.
        crops: (time, view, size, size, 4), see `crop_bytes`.
        crop_valid: (time, view), views that count; given with `crops`.
        facts: what is known of the clip, such as rig, cameras, width_px (median of the object's longer side in the
            images), distance_m.
        classes: of the data set, in the order of a classifier's answers.
    """
    arrays = {"columns": columns.astype(np.float32), "label": np.array(label), "identity": np.array(identity)}
    if crops is not None and crop_valid is not None:
        arrays |= {"crops": crops.astype(np.uint8), "crop_valid": crop_valid.astype(bool)}
    if facts:
        arrays["facts"] = np.array(json.dumps(dict(facts), sort_keys=True))
    if classes != CLASSES:
        arrays["classes"] = np.array(classes)
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)  # pyrefly: ignore


def clip_files(folder: Path) -> list[Path]:
    """The clips of a folder in the order of names; what a killed writer left is none."""
    return sorted(path for path in folder.glob("*.npz") if not path.name.startswith("."))


def one_camera_path(path: Path) -> Path:
    """Where the clip of a sequence lies of which there are crops of one camera alone, and no Gaussians: not among the
    others, so that nothing that reads a folder of clips meets one without knowing."""
    return path.parent / "one_camera" / path.name


def load_clips(*folders: Path, frames: int, crops: bool = True) -> ClipSet:
    """Read every clip of some folders in the order of names, padded with zeros or cut to `frames`.

    Args:
        folders: of clips.
        frames: of each clip in memory.
        crops: False leaves them out, which halves the memory.

    Raises:
        UserError: a folder without clips, or a clip that is broken, of other classes or of another size.
    """
    paths = []
    for folder in folders:
        paths += (found := clip_files(folder))
        if not found:
            remedy = "make them with python -m experiments.generate_clips or experiments.reconstruct_dataset"
            raise UserError("missing", f"{folder} holds no clips (*.npz)", remedy)
    clips = ((str(path), load_clip(path)) for path in paths)
    if not crops:
        clips = ((name, replace(clip, crops=None, crop_valid=None)) for name, clip in clips)
    return _packed(clips, len(paths), frames)


def pack_clips(clips: Sequence[StoredClip], *, frames: int) -> ClipSet:
    """Clips in memory, in order, padded with zeros or cut to `frames` and to `VIEWS` views.

    Raises:
        UserError: they have different classes or numbers of tokens a frame, or crops of different sizes.
    """
    return _packed(((clip.identity, clip) for clip in clips), len(clips), frames)


def _packed(clips: Iterable[tuple[str, StoredClip]], count: int, frames: int) -> ClipSet:
    """Clips with their names, put in place one by one, so that none is in memory twice."""
    columns, crops = np.zeros((0, frames, 0, 14), np.float32), None
    present, valid = np.zeros((count, frames), bool), np.zeros((count, frames, VIEWS), bool)
    label, identity, facts, classes = np.zeros(count, np.int64), [], [], CLASSES
    for index, (name, clip) in enumerate(clips):
        if index == 0:
            columns, classes = np.zeros((count, frames, *clip.columns.shape[1:]), np.float32), clip.classes
        if clip.classes != classes:
            problem = f"{name} is of the classes {', '.join(clip.classes)}, others of {', '.join(classes)}"
            raise UserError("mismatch", problem, "give clips of one data set")
        _require_equal(name, clip.columns.shape[1], columns.shape[2], "{} tokens a frame")
        length = min(len(clip.columns), frames)
        columns[index, :length], present[index, :length] = clip.columns[:length], True
        if clip.crops is not None and clip.crop_valid is not None:
            size = clip.crops.shape[2]
            if crops is None:
                crops = np.zeros((count, frames, VIEWS, size, size, 4), np.uint8)
            _require_equal(name, size, crops.shape[3], "crops of {} pixels")
            views = min(clip.crops.shape[1], VIEWS)
            crops[index, :length, :views] = clip.crops[:length, :views]
            valid[index, :length, :views] = clip.crop_valid[:length, :views]
        label[index] = classes.index(clip.label)
        identity.append(clip.identity)
        facts.append(clip.facts)
    kept = None if crops is None else valid
    return ClipSet(columns, present, label, tuple(identity), crops, kept, tuple(facts), classes)


def _require_equal(name: str, found: int, others: int, what: str) -> None:
    if found != others:
        problem = f"{name} has {what.format(found)}, others have {what.format(others)}"
        raise UserError("mismatch", problem, "make it again")


def load_clip(path: Path) -> StoredClip:
    """Read one clip.

    Raises:
        UserError: it is broken, of no class or of another layout.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            if any(entry.compress_type != zipfile.ZIP_STORED for entry in stored.zip.infolist()):
                raise ValueError("an entry is compressed, so that it may unpack to any size")
            arrays = {name: stored[name] for name in stored.files}
        clip = arrays["columns"].astype(np.float32)
        label, identity = str(arrays["label"]), str(arrays["identity"])
        facts = json.loads(str(arrays["facts"])) if "facts" in arrays else {}
        classes = tuple(str(name) for name in arrays["classes"].ravel()) if "classes" in arrays else CLASSES
    except Exception as error:  # NumPy reads headers as Python's literals, and raises whatever its tokenizer does
        raise UserError(
            "unreadable", f"{path} cannot be read as a clip ({error})", "delete it and make it again"
        ) from None
    crops, valid = arrays.get("crops"), arrays.get("crop_valid")
    fits = label in classes and clip.ndim == 3 and clip.shape[-1] == 14 and isinstance(facts, dict)
    if crops is not None or valid is not None:
        fits = fits and _crops_fit(crops, valid, clip)
    if not fits:
        raise UserError(
            "unreadable",
            f"{path} is not a clip of (time, token, 14), with or without crops, with a class of {classes}",
            "make it again",
        )
    return StoredClip(clip, label, identity, crops, valid, facts, classes)


def _crops_fit(crops: np.ndarray | None, valid: np.ndarray | None, columns: np.ndarray) -> bool:
    if crops is None or valid is None or crops.dtype != np.uint8 or valid.dtype != bool or crops.ndim != 5:
        return False
    square = crops.shape[2] == crops.shape[3] > 0 and crops.shape[4] == 4
    return square and valid.shape == crops.shape[:2] and len(valid) == len(columns)
