"""Frames of a capture as the pipeline takes them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerojax.capture.format import Capture
from aerojax.capture.frames import read_frames
from aerojax.core.types import FrameSet
from aerojax.segment.base import Preview


def capture_frames(capture: Capture) -> Iterator[FrameSet]:
    """Every frame of a capture in order.

    Raises:
        UserError: a file is missing, damaged or of another size.
    """
    return (read_frames(capture, frame) for frame in range(capture.frames))


def capture_preview(capture: Capture) -> Preview:
    """A whole capture to look at before its first frame."""

    def preview(count: int, *, rgb: bool, ids: bool) -> Iterator[FrameSet]:
        for frame in np.unique(np.linspace(0, capture.frames - 1, count).astype(int)):
            yield read_frames(capture, int(frame), rgb=rgb, ids=ids)

    return preview
