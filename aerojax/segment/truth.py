"""Object masks that the capture brings along."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Integer

from aerojax.errors import UserError


def choose_object(masks: list[Integer[np.ndarray, "height width"]], object_id: int | None) -> int:
    """The instance to follow: the given one, or the one that covers most pixels in these masks.

    Raises:
        UserError: if the given instance appears in none of them, or there is no instance at all.
    """
    totals = np.zeros(1, np.int64)
    for mask in masks:
        counts = np.bincount(mask.ravel(), minlength=len(totals))
        counts[: len(totals)] += totals
        totals = counts
    totals[0] = 0
    if object_id is None:
        if not totals.any():
            raise UserError("object: every mask of the capture is empty; check the masks, or leave them out of the capture")
        return int(np.argmax(totals))
    if object_id >= len(totals) or totals[object_id] == 0:
        present = ", ".join(str(i) for i in np.flatnonzero(totals)) or "none"
        raise UserError(f"object={object_id} appears in no mask of the capture; present: {present}")
    return object_id


def object_box(mask: Float[np.ndarray, "height width"], *, min_pixels: int = 4) -> Float[np.ndarray, "4"] | None:
    """Tight box x0, y0, x1, y1 (pixels, exclusive ends) of a mask > 0.5; None below `min_pixels`."""
    inside = mask > 0.5
    if np.count_nonzero(inside) < min_pixels:
        return None
    columns, rows = np.flatnonzero(inside.any(axis=0)), np.flatnonzero(inside.any(axis=1))
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], np.float64)


def touches_border(box: Float[np.ndarray, "4"], width: int, height: int) -> bool:
    """Whether the object may continue beyond the image, so that its outline there is not its own."""
    return bool(box[0] <= 0 or box[1] <= 0 or box[2] >= width or box[3] >= height)
