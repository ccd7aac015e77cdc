"""Axis-aligned boxes x0, y0, x1, y1 in pixels with exclusive ends. Host-side."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from aerojax.core.types import Box
from aerojax.geometry.cameras import Pinhole, project_points

__all__ = ["Box", "box_iou", "projected_box", "tight_box", "touches_border"]


def tight_box(mask: Bool[np.ndarray, "height width"], *, min_pixels: int = 1) -> Box | None:
    """The smallest box that holds every pixel of a mask; None where fewer than `min_pixels` are set."""
    if np.count_nonzero(mask) < min_pixels:
        return None
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    return float(columns[0]), float(rows[0]), float(columns[-1] + 1), float(rows[-1] + 1)


def projected_box(points_world: Float[np.ndarray, "point 3"], camera: Pinhole) -> Box | None:
    """Box around projected points (metres, world), not clipped to the image; None if any is behind the camera."""
    pixels = project_points(points_world, camera, behind=np.nan)
    if np.isnan(pixels).any():
        return None
    (x0, y0), (x1, y1) = pixels.min(axis=0).tolist(), pixels.max(axis=0).tolist()
    return x0, y0, x1, y1


def box_iou(a: Box, b: Box) -> float:
    """Intersection over union of two boxes, 0 where they do not meet."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    both = max(width, 0.0) * max(height, 0.0)
    areas = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1])
    return both / (areas - both) if both > 0 else 0.0


def touches_border(box: Box, width: int, height: int) -> bool:
    """Whether what the box holds may continue beyond the image, so that its outline there is not its own."""
    return box[0] <= 0 or box[1] <= 0 or box[2] >= width or box[3] >= height
