"""Where backgrounds are open sky: nothing stands there that could hide an object.

A camera that shows no change where others see an object speaks against it only if it would show it. Before trees and
walls it may be hidden.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float32

from aerojax.core.colour import as_bytes
from aerojax.segment.voxel_vote.cluster import Region

Sky = Bool[np.ndarray, "rows columns"]
"""Where an image shows sky; it may be smaller than the camera's."""
LEAST_CONTRAST = 0.15
"""Between the mean brightness of sky and of the rest, grey; where it is less no sky is told from anything."""


def open_sky(greys: Sequence[Float32[np.ndarray, "_ _"] | None]) -> tuple[Sky | None, ...]:
    """Pixels of all cameras that are brighter than one threshold, which parts sky from canopy best (Otsu 1979).

    One threshold for all: a camera may see trees alone.

    Args:
        greys: brightness of the backgrounds, 0..1, of any size; None for a camera whose background is not known.

    Returns:
        All True where there is no contrast, so that every camera that sees a place speaks.
    """
    known = [as_bytes(one) for one in greys if one is not None]
    if not known:
        return tuple(None for _ in greys)
    values = np.concatenate([one.ravel() for one in known])[None]
    level = cv2.threshold(values, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[0]
    bright = values > level
    parted = bright.any() and not bright.all()
    if not parted or values[bright].mean() - values[~bright].mean() < 255 * LEAST_CONTRAST:
        level = -1.0
    return tuple(None if one is None else np.asarray(255 * one > level) for one in greys)


def is_before(region: Region | None, sky: Sky | None, shape: tuple[int, ...]) -> bool:
    """Whether most of a region's window, in an image of this shape, is known to show sky."""
    if region is None or sky is None:
        return False
    rows, columns = (
        slice(int(part.start * small / whole), int(np.ceil(part.stop * small / whole)))
        for part, small, whole in zip(region.window, sky.shape, shape, strict=True)
    )
    return bool(sky[rows, columns].mean() >= 0.5)
