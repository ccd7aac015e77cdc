"""Backgrounds of a whole capture that is looked at before its first frame.

Its images are laid upon each other first: a median of images that sway is blurred, and every steep pixel of it varies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from aerojax.core.colour import as_bytes, as_floats
from aerojax.segment.voxel_vote.background import (
    Background,
    BackgroundConfig,
    as_background,
    difference_of,
    grey,
    learnt,
)
from aerojax.segment.voxel_vote.registration import reduction, slopes

NEIGHBOURS = 25
"""Pixels of `coarse` along a side of the neighbourhood whose usual deviation is compared, a twentieth of the width."""
UNUSUAL = 1.5
"""Times its neighbourhood's deviation that a pixel may have: leaves wave together, an object blinds a few alone."""
STEEP = 0.95
"""Share of the pixels that are less steep than those by which a sway that is left is measured."""
MOST_SWAY_PX = 2.0
"""Pixels; what varies more than that by steepness is not the camera's sway."""
_THOUSANDTHS = 1000
"""Deviations as bytes, for a median of large neighbourhoods: up to a quarter."""

Bytes = UInt8[np.ndarray, "height width 3"]


def previewed(images: Sequence[Bytes], config: BackgroundConfig) -> tuple[Background, list[Bytes]]:
    """The background of a camera's images, and these images in its place and light."""
    first = learnt(images, replace(config, model="running"))
    steady = []
    for image in images:
        seen = as_floats(image)
        steady.append(as_bytes(as_background(seen, difference_of(seen, first, config), first)))
    return _usual(learnt(steady, config), first), steady


def _usual(known: Background, first: Background) -> Background:
    """With deviations that neighbours have, too: those of a pixel that an object covers now and then are the object's.

    Steep pixels of a camera that sways where nothing tells how far (before a sky) keep what the sway explains. What
    light and clouds do to a neighbourhood counts although it was taken out: it returns with the next frame.

    Args:
        known: of images in one place and light. first: of the images as they were.
    """
    deviation = np.sqrt(known.variance)
    slope = cv2.magnitude(*slopes(grey(known.mean)))
    steep = slope > max(float(np.quantile(slope[::3, ::3], STEEP)), 1e-6)
    sway = min(float(np.median(deviation[steep] / slope[steep])), MOST_SWAY_PX) if steep.any() else 0.0
    most = UNUSUAL * np.sqrt(_around(deviation) ** 2 + np.float32(sway**2) * slope * slope)
    least = _around(np.sqrt(first.variance))
    return replace(known, variance=np.maximum(np.minimum(deviation, most), least) ** 2)


def _around(deviation: Float32[np.ndarray, "height width"]) -> Float32[np.ndarray, "height width"]:
    """Median of each pixel's neighbourhood."""
    height, width = deviation.shape
    factor = reduction(width)
    small = cv2.resize(deviation, (width // factor, height // factor), interpolation=cv2.INTER_AREA)
    usual = cv2.medianBlur(np.round(small * _THOUSANDTHS).astype(np.uint8), NEIGHBOURS)
    return cv2.resize(usual.astype(np.float32) / _THOUSANDTHS, (width, height))
