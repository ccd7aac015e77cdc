"""How far a camera's image is displaced from its background: masts sway and tripods are knocked."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32

Grey = Float32[np.ndarray, "rows columns"]
Offset = tuple[float, float]
"""Pixels right and down."""

STILL: Offset = (0.0, 0.0)
LEAST_OFFSET = 0.05
"""Pixels; less is not told from noise, and a background that is not resampled stays sharp."""
MOST_OFFSET = 0.05
"""Share of the image's width; a camera that turned further needs another calibration."""
BETTER = 0.95
"""What is left of the difference at steep pixels with a displacement that is believed, at most."""
STEPS = 3
"""Of Gauss and Newton; phase correlation starts them within half a pixel."""
_COARSE_WIDTH = 480
"""Columns of the images that are compared, at most about."""


def coarse(image: Float32[np.ndarray, "height width 3"]) -> Grey:
    """The image's grey values, reduced by the whole number that brings it near the width at which shifts are sought."""
    height, width = image.shape[:2]
    factor = reduction(width)
    small = cv2.resize(image, (width // factor, height // factor), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(small, cv2.COLOR_RGB2GRAY)


def reduction(width: int) -> int:
    """Pixels of an image in one of `coarse`."""
    return max(1, round(width / _COARSE_WIDTH))


def offset_of(seen: Grey, still: Grey) -> Offset:
    """The translation by which `seen` is displaced from `still`, in pixels of these two; (0, 0) where none explains it.

    Phase correlation (Kuglin & Hines 1975), then Gauss-Newton on the pixels that fit (Lucas & Kanade 1981), so that a
    moving object does not pull. What does not make the pictures more alike is not believed: a sky has no texture.

    Args:
        seen, still: of one size; of unlike brightness if need be.
    """
    seen, still = seen - seen.mean(), still - still.mean()
    window = cv2.createHanningWindow(seen.shape[::-1], cv2.CV_32F)
    start, _ = cv2.phaseCorrelate(still, seen, window)
    steep = _steep(still)
    least = BETTER * _misfit(seen, still, steep)
    for guess in (start, STILL):
        found = _refined(seen, still, guess)
        if max(map(abs, found)) <= MOST_OFFSET * seen.shape[1]:
            misfit = _misfit(seen, displaced(still, found), steep)
            if misfit < least:
                return found
    return STILL


def displaced(image: np.ndarray, offset: Offset) -> np.ndarray:
    """An image whose content moved by so many pixels right and down; its border is repeated."""
    if offset == STILL:
        return image
    moved = np.array([[1.0, 0.0, offset[0]], [0.0, 1.0, offset[1]]])
    size = image.shape[1], image.shape[0]
    return cv2.warpAffine(image, moved, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def _steep(still: Grey) -> Bool[np.ndarray, "rows columns"]:
    """The steepest tenth of the pixels, where a displacement shows most."""
    slope = cv2.magnitude(*slopes(still))
    return slope >= np.quantile(slope[::2, ::2], 0.9)


def slopes(image: Grey) -> tuple[Grey, Grey]:
    """Derivatives along columns and rows, per pixel (Sobel)."""
    return cv2.Sobel(image, cv2.CV_32F, 1, 0, scale=1 / 8), cv2.Sobel(image, cv2.CV_32F, 0, 1, scale=1 / 8)


def _misfit(seen: Grey, still: Grey, steep: Bool[np.ndarray, "rows columns"]) -> float:
    """Mean absolute difference of the steep pixels without the largest tenth, which is what moves."""
    difference = np.abs(seen - still)[steep]
    kept = max(1, int(0.9 * difference.size))
    return float(np.partition(difference, kept - 1)[:kept].mean())


def _refined(seen: Grey, still: Grey, offset: Offset) -> Offset:
    """Gauss-Newton on the pixels whose difference is no outlier."""
    right, down = offset
    for _ in range(STEPS):
        moved = displaced(still, (right, down))
        gx, gy = slopes(moved)
        residual = seen - moved
        size = np.abs(residual)
        fits = size <= 4.0 * max(float(np.median(size[::3, ::3])), 1e-4)
        gx, gy, residual = gx[fits], gy[fits], residual[fits]
        normal = np.array([[gx @ gx, gx @ gy], [gx @ gy, gy @ gy]], np.float64)
        if np.linalg.det(normal) <= 1e-9 * max(normal.trace(), 1e-12) ** 2:
            return right, down
        step = np.linalg.solve(normal, np.array([gx @ residual, gy @ residual], np.float64))
        right, down = right - float(step[0]), down - float(step[1])
    return right, down
