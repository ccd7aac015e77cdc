"""Observations whose figures are known."""

from __future__ import annotations

import numpy as np

from aerojax.evaluate.dataset_qa.observations import Observations


def view(**changes: object) -> Observations:
    """One view of a bird of 100×50 pixels at 10 m, in which everything agrees; `changes` are values of columns."""
    box = (100.0, 100.0, 200.0, 150.0)
    agreed: dict[str, object] = {
        **{"sequence": 0, "tracked": 0, "label": 0, "frame": 0, "camera": 0, "size": (640.0, 360.0)},
        **{"distance": 10.0, "focal": 1000.0, "truncated": False, "visibility": 1.0, "area": 3000.0},
        **{"covered": 3000.0, "projected_box": box, "mask_box": box, "covered_box": box, "centroid": (150.0, 125.0)},
        **{"depth_centroid": (150.0, 125.0), "surface_pixel": (150.0, 125.0), "origin_pixel": (153.0, 129.0)},
        "position": (0.0, 0.0, 0.0),
    }
    return Observations(**{name: np.array([value]) for name, value in (agreed | changes).items()})  # type: ignore[arg-type]
