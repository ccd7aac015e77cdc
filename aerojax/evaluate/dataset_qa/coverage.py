"""What a data set covers: places in images, sizes, distances, cameras that see an object (thesis Figs. 6.1-6.4)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from aerojax.core.types import CLASSES
from aerojax.evaluate.dataset_qa.observations import Observations

HEAT_ROWS, HEAT_COLUMNS = 36, 64
"""Cells of a heat map: 16:9."""

AREA_EDGES = (0.0, 144.0, 400.0, 1024.0, 2000.0, 8000.0, 32000.0, 128000.0, np.inf)
"""Pixels of a mask: SODA's extremely, relatively and generally small and normal (Cheng et al. 2023), then fourfold."""
AREA_NAMES = ("≤ 144", "≤ 400", "≤ 1024", "≤ 2000", "≤ 8k", "≤ 32k", "≤ 128k", "larger")

SWEEP = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 100.0, 140.0, 200.0, 280.0)
"""Radii of the Sim-1 sweep, metres; each has a bin whose ends are the geometric means with its neighbours."""


def heat_map(views: Observations) -> Float[np.ndarray, "rows columns"]:
    """log(1 + number) of silhouettes with their centroid in each cell of the image."""
    place = (views.centroid / views.size)[views.in_view]
    counts, _, _ = np.histogram2d(
        place[:, 1], place[:, 0], bins=(HEAT_ROWS, HEAT_COLUMNS), range=((0.0, 1.0), (0.0, 1.0))
    )
    return np.log1p(counts)


def area_histogram(views: Observations) -> Int[np.ndarray, "label bin"]:
    """Views by class and mask area; a bin holds its upper edge, as SODA's do."""
    seen = views.where(views.in_view)
    which = np.searchsorted(AREA_EDGES, seen.area, side="left") - 1
    return _by_class(seen.label, which, len(AREA_NAMES))


def distance_edges() -> Float[np.ndarray, "edge"]:
    """Ends of the distance bins, metres; the first begins at 0 and the last does not end."""
    inner = np.sqrt(np.array(SWEEP[:-1]) * np.array(SWEEP[1:]))
    return np.concatenate([[0.0], inner, [np.inf]])


def distance_histogram(views: Observations) -> Int[np.ndarray, "label bin"]:
    """Views by class and distance from camera to body."""
    seen = views.where(views.in_view)
    which = np.searchsorted(distance_edges(), seen.distance, side="right") - 1
    return _by_class(seen.label, which, len(SWEEP))


def _by_class(label: np.ndarray, which: np.ndarray, bins: int) -> Int[np.ndarray, "label bin"]:
    counts = np.zeros((len(CLASSES), bins), np.int64)
    np.add.at(counts, (label, which), 1)
    return counts


def visibility_curve(views: Observations) -> Float[np.ndarray, "cameras"]:
    """Share of moments (object and frame) in which at least k cameras see the object, k = 1 … all cameras.

    A camera sees it where the mask has a pixel of it; moments are those of every camera, recording or not.
    """
    moments, moment = np.unique(np.stack([views.sequence, views.tracked, views.frame]), axis=1, return_inverse=True)
    cameras = np.bincount(moment.ravel(), weights=views.in_view, minlength=moments.shape[1])
    most = int(views.camera.max(initial=0)) + 1
    return np.array([(cameras >= k).mean() for k in range(1, most + 1)])
