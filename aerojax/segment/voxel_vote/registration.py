"""How far a camera's image is displaced from its background: masts sway and tripods are knocked."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32, Int32

Grey = Float32[np.ndarray, "rows columns"]
Offset = tuple[float, float]
"""Pixels right and down."""

STILL: Offset = (0.0, 0.0)
LEAST_OFFSET = 0.05
"""Pixels; less is not told from noise, and a background that is not resampled stays sharp."""
MOST_OFFSET = 0.05
"""Share of the image's width; a camera that turned further needs another calibration."""
BETTER = 0.9
"""What is left of the difference in the median block with a displacement that is believed, at most."""
BLOCKS = 12
"""Blocks along a side of an image."""
FEWEST_STEEP, FEWEST_BLOCKS = 6, 24
"""Steep pixels of a block that counts, and blocks that count of an image whose displacement can be told."""
SLOW = 3.0
"""Pixels; what changes over more of them is left out (standard deviation of a Gaussian)."""
LEAST_SLOPE, TEXTURED = 0.004, 0.02
"""Grey values a pixel: less is noise, more is texture even where all of the image has it."""
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
    moving object does not pull. It is believed if it makes most textured parts of the image more alike; where few have
    texture, as before a sky, nothing is known.

    Args:
        seen, still: of one size; of unlike brightness if need be.
    """
    seen, still = _detail(seen), _detail(still)
    blocks = _blocks(still)
    if np.count_nonzero(np.bincount(blocks[blocks >= 0], minlength=1) >= FEWEST_STEEP) < FEWEST_BLOCKS:
        return STILL
    before = _misfits(seen, still, blocks)
    window = cv2.createHanningWindow(seen.shape[::-1], cv2.CV_32F)
    start, _ = cv2.phaseCorrelate(still, seen, window)
    for guess in (start, STILL):
        found = _refined(seen, still, guess)
        if max(map(abs, found)) <= MOST_OFFSET * seen.shape[1]:
            after = _misfits(seen, displaced(still, found), blocks)
            if np.median(after / before) < BETTER:
                return found
    return STILL


def _detail(image: Grey) -> Grey:
    """An image without its slow changes, which are as much of the light as of a displacement."""
    return image - cv2.GaussianBlur(image, (0, 0), SLOW)


def _blocks(still: Grey) -> Int32[np.ndarray, "rows columns"]:
    """The block of `BLOCKS`² that each steep pixel lies in, -1 for the others.

    Steep is what exceeds the usual slope, which is noise, four times. What moves lies in a few blocks, what the camera
    stands before in many.
    """
    slope = cv2.magnitude(*slopes(still))
    rows = np.arange(still.shape[0]) * BLOCKS // still.shape[0]
    columns = np.arange(still.shape[1]) * BLOCKS // still.shape[1]
    steep = slope > np.maximum(LEAST_SLOPE, 4 * np.median(slope[::3, ::3]))
    steep |= slope > TEXTURED
    rim = int(3 * SLOW)  # where the blur has no neighbours, every ramp is steep
    steep[:rim] = steep[-rim:] = steep[:, :rim] = steep[:, -rim:] = False
    return np.where(steep, rows[:, None] * BLOCKS + columns, -1).astype(np.int32)


def displaced(image: np.ndarray, offset: Offset) -> np.ndarray:
    """An image whose content moved by so many pixels right and down; its border is repeated."""
    if offset == STILL:
        return image
    moved = np.array([[1.0, 0.0, offset[0]], [0.0, 1.0, offset[1]]])
    size = image.shape[1], image.shape[0]
    return cv2.warpAffine(image, moved, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def slopes(image: Grey) -> tuple[Grey, Grey]:
    """Derivatives along columns and rows, per pixel (Sobel)."""
    return cv2.Sobel(image, cv2.CV_32F, 1, 0, scale=1 / 8), cv2.Sobel(image, cv2.CV_32F, 0, 1, scale=1 / 8)


def _misfits(seen: Grey, still: Grey, blocks: Int32[np.ndarray, "rows columns"]) -> Float32[np.ndarray, "block"]:
    """Mean absolute difference of the steep pixels of each block that has enough of them."""
    steep = blocks >= 0
    counts = np.bincount(blocks[steep], minlength=BLOCKS**2)
    sums = np.bincount(blocks[steep], weights=np.abs(seen - still)[steep], minlength=BLOCKS**2)
    enough = counts >= FEWEST_STEEP
    return np.maximum(sums[enough] / counts[enough], 1e-6).astype(np.float32)


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
