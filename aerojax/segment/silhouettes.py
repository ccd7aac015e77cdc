"""From an image's coverage to a silhouette."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from aerojax.core.types import Silhouette
from aerojax.geometry.boxes import tight_box, touches_border

FEWEST_PIXELS = 4
"""An object that covers fewer pixels is no object: single pixels are noise."""


def silhouette_of(camera: int, object_id: int, coverage: Float32[np.ndarray, "height width"]) -> Silhouette | None:
    """The silhouette in one camera; None where the object covers next to nothing.

    Args:
        camera: index in the network.
        object_id: as the segmenter numbers its objects.
        coverage: share of each pixel that the object covers, 0..1.
    """
    box = tight_box(coverage > 0.5, min_pixels=FEWEST_PIXELS)
    if box is None:
        return None
    height, width = coverage.shape
    return Silhouette(camera, object_id, coverage, box, whole=not touches_border(box, width, height))
