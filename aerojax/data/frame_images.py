"""Whole images of rendered sequences, made smaller, with the object's box: what detectors learn from and are asked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int, UInt8

from aerojax.capture.format import Capture, read_capture
from aerojax.capture.frames import read_view
from aerojax.core.config import require_at_least
from aerojax.core.errors import UserError
from aerojax.core.seeds import seed_of
from aerojax.core.types import CLASSES
from aerojax.data.manifest import SequenceEntry
from aerojax.geometry.boxes import tight_box


@dataclass(frozen=True, eq=False)
class FrameImages:
    """Images of one camera each, in windows of consecutive frames.

    images: sRGB, 255 for 1, the newest last. box: of the object in the newest one, x0 y0 x1 y1, pixels of `images`.
    seen: whether the object is in it; without, its box means nothing.
    label: index into `CLASSES`. sequence: which sequence of those that were asked for. camera: of it. frame: the
        newest one's number. width_px: longer side of the box in the image as it was recorded.
    """

    images: UInt8[np.ndarray, "example window height width 3"]
    box: Float32[np.ndarray, "example 4"]
    seen: Bool[np.ndarray, "example"]
    label: Int[np.ndarray, "example"]
    sequence: Int[np.ndarray, "example"]
    camera: Int[np.ndarray, "example"]
    frame: Int[np.ndarray, "example"]
    width_px: Float32[np.ndarray, "example"]


@dataclass(frozen=True)
class ImageChoice:
    """Which images of a sequence are read.

    frames: of a camera, evenly spread; all if there are no more.
    cameras: of a sequence, drawn; 0 for all.
    """

    frames: int = 1
    cameras: int = 0

    def __post_init__(self) -> None:
        """Refuse what chooses nothing.

        Raises:
            UserError: names the field and a value that works.
        """
        require_at_least(self, "frames")
        require_at_least(self, "cameras", least=0)


def read_frame_images(
    sequences: Sequence[SequenceEntry],
    choice: ImageChoice,
    *,
    size: tuple[int, int],
    window: int,
    seed: int,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> FrameImages:
    """Read some frames of some cameras of every sequence; which ones depends on the seed and the sequence alone.

    Args:
        sequences: with one object each that counts, the first one.
        choice: of frames, each the newest of an example, and of cameras.
        size: height and width of the images in memory; recorded ones are averaged down to it.
        window: consecutive frames of an example; before a recording's first frame that one stands again.
        seed: of the draw.
        progress: called after each sequence.

    Raises:
        UserError: nothing is asked for, or a file is missing or damaged.
    """
    if not sequences:
        raise UserError("missing", "no sequences to read images of", "name a data set that has the split")
    rows: list[tuple] = []
    for index, entry in enumerate(sequences):
        capture, draw = read_capture(entry.folder), np.random.default_rng(seed_of(seed, entry.name))
        chosen = draw.permutation(len(capture.cameras))[: choice.cameras or None]
        for camera in sorted(chosen.tolist()):
            newest = np.unique(np.linspace(0, capture.frames - 1, choice.frames).round().astype(int))
            for one in _camera_examples(capture, camera, newest.tolist(), size, window):
                rows.append((*one, CLASSES.index(entry.label), index, camera))
        progress(index + 1, len(sequences), "sequences")
    images, box, seen, width, frame, label, sequence, camera = zip(*rows, strict=True)
    label, sequence, camera, frame = (np.array(values, np.int64) for values in (label, sequence, camera, frame))
    boxes, widths = np.stack(box), np.array(width, np.float32)
    return FrameImages(np.stack(images), boxes, np.array(seen), label, sequence, camera, frame, widths)


def _camera_examples(
    capture: Capture, camera: int, newest: list[int], size: tuple[int, int], window: int
) -> list[tuple[np.ndarray, np.ndarray, bool, float, int]]:
    """Images, box, whether it is seen, its width as recorded and the frame's number."""
    needed = sorted({max(frame - back, 0) for frame in newest for back in range(window)})
    small: dict[int, np.ndarray] = {}
    found: dict[int, tuple[np.ndarray, bool, float]] = {}
    for frame in needed:
        image, ids, _ = read_view(capture, camera, frame, rgb=True, ids=frame in newest)
        if image is None:
            image = np.zeros((capture.cameras[camera].height, capture.cameras[camera].width, 3), np.float32)
        small[frame] = np.rint(255 * cv2.resize(image, size[::-1], interpolation=cv2.INTER_AREA)).astype(np.uint8)
        if frame in newest:
            found[frame] = _box(ids, image.shape[:2], size)
    return [(np.stack([small[max(f - back, 0)] for back in range(window - 1, -1, -1)]), *found[f], f) for f in newest]


def _box(ids: np.ndarray | None, recorded: tuple[int, int], size: tuple[int, int]) -> tuple[np.ndarray, bool, float]:
    box = None if ids is None else tight_box(ids == 1)
    if box is None:
        return np.zeros(4, np.float32), False, 0.0
    scale = np.array([size[1] / recorded[1], size[0] / recorded[0]] * 2)
    return (np.array(box) * scale).astype(np.float32), True, max(box[2] - box[0], box[3] - box[1])
