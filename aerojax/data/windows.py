"""Equally long windows of clips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32, Int, UInt8

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.clips import clip_files, load_clips


@dataclass(frozen=True)
class Windows:
    """Equally long windows of videos.

    name: of the window, `rig/split/sequence@start`.
    video: index of the window's video; videos are numbered by their order.
    identity: of the window's object.
    crops, crop_valid: as in `ClipSet`; None where no clip has any.
    classes: as in `ClipSet`.
    """

    columns: Float32[np.ndarray, "window time token 14"]
    present: Bool[np.ndarray, "window time"]
    label: Int[np.ndarray, "window"]
    video: Int[np.ndarray, "window"]
    name: tuple[str, ...]
    identity: tuple[str, ...]
    crops: UInt8[np.ndarray, "window time view size size 4"] | None = None
    crop_valid: Bool[np.ndarray, "window time view"] | None = None
    classes: tuple[str, ...] = CLASSES

    def one_a_video(self) -> np.ndarray:
        """Index of the first window of every video."""
        return np.unique(self.video, return_index=True)[1]

    def spread(self, count: int) -> Windows:
        """The first windows of at most `count` videos, spread evenly over them, each a video of its own."""
        first = self.one_a_video()
        chosen = first[np.unique(np.linspace(0, len(first) - 1, count).round().astype(int))]
        arrays = (self.columns[chosen], self.present[chosen], self.label[chosen], np.arange(len(chosen)))
        names = tuple(self.name[i] for i in chosen), tuple(self.identity[i] for i in chosen)
        crops = None if self.crops is None else self.crops[chosen]
        valid = None if self.crop_valid is None else self.crop_valid[chosen]
        return Windows(*arrays, *names, crops, valid, self.classes)


def window_starts(frames: int, length: int, stride: int, *, dilation: int = 1, cover: bool = True) -> list[int]:
    """First frames of the clips of a video.

    Args:
        frames: frames of the video.
        length: frames of a clip.
        stride: frames between the starts of two clips.
        dilation: frames between two frames of a clip.
        cover: adds one clip at the very end where the stride would leave frames unseen.

    Returns:
        Starts in order; [0] for a video shorter than a clip (pad and mask it).

    Raises:
        UserError: if a size is below one.
    """
    for name, value in (("frames", frames), ("length", length), ("stride", stride), ("dilation", dilation)):
        if value < 1:
            raise UserError("invalid", f"{name} is {value}", "it must be at least 1")
    last = frames - (length - 1) * dilation - 1
    if last < 0:
        return [0]
    starts = list(range(0, last + 1, stride))
    return [*starts, last] if cover and starts[-1] != last else starts


def read_windows(folders: Sequence[Path], split: str, *, frames: int, length: int, stride: int, tokens: int) -> Windows:
    """Windows of every clip of a split, from each start that the stride reaches and the last one.

    Args:
        folders: of `reconstruct_dataset`, one a rig.
        split: train, val or test.
        frames: clips are cut to so many.
        length: frames of a window; a shorter clip gives one window with absent frames at its end.
        stride: between starts.
        tokens: of a frame that are kept, the first ones (they lie in random order).
    """
    stems = [(folder.name, path.stem) for folder in folders for path in clip_files(folder / split)]
    clips = load_clips(*(folder / split for folder in folders), frames=max(frames, length))
    where = [
        (index, start)
        for index, present in enumerate(clips.present)
        for start in window_starts(max(int(present.sum()), 1), length, stride)
    ]

    def cut(values: np.ndarray) -> np.ndarray:
        return np.stack([values[index, start : start + length] for index, start in where])

    video = np.array([index for index, _ in where])
    return Windows(
        cut(clips.columns)[:, :, :tokens],
        cut(clips.present),
        clips.label[video],
        video,
        tuple(f"{stems[index][0]}/{split}/{stems[index][1]}@{start}" for index, start in where),
        tuple(clips.identity[index] for index in video),
        None if clips.crops is None else cut(clips.crops),
        None if clips.crop_valid is None else cut(clips.crop_valid),
        clips.classes,
    )
