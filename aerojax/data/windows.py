"""Equally long windows of clips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32, Int

from aerojax.core.errors import UserError
from aerojax.data.clips import clip_files, load_clips


@dataclass(frozen=True)
class Windows:
    """Equally long windows of videos.

    name: of the window, `rig/split/sequence@start`.
    video: index of the window's video; videos are numbered by their order.
    identity: of the window's object.
    """

    columns: Float32[np.ndarray, "window time token 14"]
    present: Bool[np.ndarray, "window time"]
    label: Int[np.ndarray, "window"]
    video: Int[np.ndarray, "window"]
    name: tuple[str, ...]
    identity: tuple[str, ...]

    def one_a_video(self) -> np.ndarray:
        """Index of the first window of every video."""
        return np.unique(self.video, return_index=True)[1]

    def spread(self, count: int) -> Windows:
        """The first windows of at most `count` videos, spread evenly over them, each a video of its own."""
        first = self.one_a_video()
        chosen = first[np.unique(np.linspace(0, len(first) - 1, count).round().astype(int))]
        arrays = (self.columns[chosen], self.present[chosen], self.label[chosen], np.arange(len(chosen)))
        return Windows(*arrays, tuple(self.name[i] for i in chosen), tuple(self.identity[i] for i in chosen))


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
    columns, present, label, video, name, identity = [], [], [], [], [], []
    videos = 0
    for folder in folders:
        clips = load_clips(folder / split, frames=max(frames, length))
        stems = [path.stem for path in clip_files(folder / split)]
        for index, stem in enumerate(stems):
            for start in window_starts(max(int(clips.present[index].sum()), 1), length, stride):
                columns.append(clips.columns[index, start : start + length, :tokens])
                present.append(clips.present[index, start : start + length])
                label.append(clips.label[index])
                video.append(videos)
                name.append(f"{folder.name}/{split}/{stem}@{start}")
                identity.append(clips.identity[index])
            videos += 1
    stacked = np.stack(columns), np.stack(present), np.array(label), np.array(video)
    return Windows(*stacked, tuple(name), tuple(identity))
