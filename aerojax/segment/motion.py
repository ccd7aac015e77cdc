"""Masks without annotation: what moves in front of a static camera's background."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, Integer


def background(frames: list[Float[np.ndarray, "height width 3"]]) -> Float[np.ndarray, "height width 3"]:
    """Per-pixel median of a camera's frames; right where the object covers a pixel less than half the time."""
    return np.median(np.stack(frames), axis=0).astype(np.float32)


def motion_mask(
    image: Float[np.ndarray, "height width 3"], still: Float[np.ndarray, "height width 3"], *, threshold: float = 0.03
) -> Integer[np.ndarray, "height width"]:
    """The largest connected region that differs from the background: 1 inside, 0 outside.

    Args:
        image, still: sRGB 0..1 of one camera, and its background.
        threshold: least difference of any channel; raised to six times the image's own noise (robust, by the median).
    """
    difference = np.max(np.abs(image - still), axis=-1)
    noise = 1.4826 * float(np.median(difference))
    moving = (cv2.GaussianBlur(difference, (0, 0), 0.6) > max(threshold, 6 * noise)).astype(np.uint8)
    # Join parts that thin arms connect before components are counted, then keep only real pixels of the winner.
    joined = cv2.morphologyEx(moving, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    if count < 2:
        return np.zeros(moving.shape, np.uint16)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return _without_halo(((labels == largest) & (moving > 0)).astype(np.uint8), difference).astype(np.uint16)


def _without_halo(
    found: Integer[np.ndarray, "height width"], difference: Float[np.ndarray, "height width"]
) -> Integer[np.ndarray, "height width"]:
    """Drop rim pixels that differ far less than a neighbour does.

    The object covers only part of them: a faint threshold takes in pixels of a tenth's coverage where the contrast is
    strong. Comparing with the neighbourhood asks for about 0.4 whatever the contrast, and keeps rods one pixel wide.
    """
    square = np.ones((3, 3), np.uint8)
    core = cv2.erode(found, square)
    solid = difference > 0.4 * cv2.dilate(difference, square)
    return np.where(solid, found, core)
