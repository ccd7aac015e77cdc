"""B2-lite: a correlation tracker carries the last detection's label over frames in which nothing is detected."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from aerojax.core.errors import UserError


class BoxTracker(Protocol):
    """What OpenCV's trackers can do; boxes are x, y, width, height, whole pixels."""

    def init(self, image: np.ndarray, box: tuple[int, int, int, int]) -> None:
        """Begin with a box of an image."""
        ...

    def update(self, image: np.ndarray) -> tuple[bool, Any]:
        """Whether it is still there, and its box in the next image."""
        ...


def csrt_trackers() -> Callable[[], BoxTracker]:
    """Maker of CSRT trackers (Lukežič et al. 2017) of this OpenCV.

    Raises:
        UserError: it has none, because it was built without the contributed modules.
    """
    make = getattr(cv2, "TrackerCSRT_create", None) or getattr(getattr(cv2, "TrackerCSRT", None), "create", None)
    if make is None:
        problem = f"OpenCV {cv2.__version__} of this environment has no TrackerCSRT, which B2-lite follows boxes with"
        remedy = "pip install --no-deps --target contrib opencv-contrib-python-headless; run with PYTHONPATH=contrib"
        raise UserError("unavailable", problem, remedy)
    return make


def bridged(
    images: UInt8[np.ndarray, "time height width 3"],
    box: Float[np.ndarray, "time 4"],
    label: Int[np.ndarray, "time"],
    confidence: Float[np.ndarray, "time"],
    detected: Bool[np.ndarray, "time"],
    make: Callable[[], BoxTracker],
) -> tuple[Int[np.ndarray, "time"], Float[np.ndarray, "time"], Bool[np.ndarray, "time"]]:
    """Labels of one camera's frames: of its own detection, or else of the last one while the tracker follows it.

    Args:
        images: consecutive ones of the camera.
        box: of each frame's detection, x0, y0, x1, y1, pixels.
        label, confidence: of the detections.
        detected: which of them count. Each of those begins a track anew.
        make: of trackers.

    Returns:
        Label, confidence and whether there is any, of each frame.
    """
    label, confidence, known = label.copy(), confidence.copy(), detected.copy()
    tracker: BoxTracker | None = None
    for now in range(len(images)):
        if detected[now]:
            whole = _whole_box(box[now], images.shape[1:3])
            tracker = None if whole is None else make()
            if tracker is not None and whole is not None:
                tracker.init(images[now], whole)
        elif tracker is not None and tracker.update(images[now])[0]:
            label[now], confidence[now], known[now] = label[now - 1], confidence[now - 1], True
        else:
            tracker = None
    return label, confidence, known


def followed(
    images: UInt8[np.ndarray, "example height width 3"],
    box: Float[np.ndarray, "example 4"],
    label: Int[np.ndarray, "example"],
    confidence: Float[np.ndarray, "example"],
    detected: Bool[np.ndarray, "example"],
    *,
    camera: Int[np.ndarray, "example"],
    make: Callable[[], BoxTracker],
) -> tuple[Int[np.ndarray, "example"], Float[np.ndarray, "example"], Bool[np.ndarray, "example"]]:
    """`bridged` of every camera by itself; `camera` tells whose each image is, which lie in the order of their time."""
    label, confidence, known = label.copy(), confidence.copy(), detected.copy()
    for one in np.unique(camera):
        own = np.flatnonzero(camera == one)
        found = bridged(images[own], box[own], label[own], confidence[own], detected[own], make)
        label[own], confidence[own], known[own] = found
    return label, confidence, known


def _whole_box(box: Float[np.ndarray, "4"], size: tuple[int, int]) -> tuple[int, int, int, int] | None:
    """The box's part in the image; None where it is too small to be followed."""
    low = np.clip(np.floor(box[:2]), 0, np.array(size[::-1]) - 1).astype(int)
    high = np.clip(np.ceil(box[2:]), 0, size[::-1]).astype(int)
    width, height = (high - low).tolist()
    return (int(low[0]), int(low[1]), width, height) if min(width, height) >= 2 else None
