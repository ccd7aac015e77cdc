"""Object masks that the capture brings along."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Integer

from aerojax.core.errors import UserError


def choose_object(masks: Iterable[Integer[np.ndarray, "height width"]], object_id: int | None) -> int:
    """The instance to follow: the given one, or the one that covers most pixels in these masks.

    Raises:
        UserError: if the given instance appears in none of them, or there is no instance at all.
    """
    totals = np.zeros(1, np.int64)
    for mask in masks:
        counts = np.bincount(mask.ravel(), minlength=len(totals))
        if object_id is not None and 0 < object_id < len(counts) and counts[object_id]:
            return object_id
        counts[: len(totals)] += totals
        totals = counts
    totals[0] = 0
    if object_id is None:
        if not totals.any():
            raise UserError(
                "object-absent",
                "object: every mask of the capture is empty",
                "check the masks, or leave them out of the capture",
            )
        return int(np.argmax(totals))
    present = ", ".join(str(i) for i in np.flatnonzero(totals)) or "none"
    raise UserError("object-absent", f"object={object_id} appears in no mask of the capture", f"present: {present}")
