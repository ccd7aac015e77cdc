"""How well masks, trajectories and cameras of a data set agree, and why where they do not (thesis Table 6.4).

Every disagreement beyond a limit is put down to the first cause that accounts for it; what none accounts for is an
error of the data set.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from aerojax.evaluate.dataset_qa.boxes import box_overlaps, clip_boxes
from aerojax.evaluate.dataset_qa.observations import Observations

IOU_LIMIT, RESIDUAL_LIMIT = 0.95, 0.5
"""Below and above (pixels) which a view's disagreement is put down to a cause."""
WHOLE = 0.99  # least visibility of an object that nothing hides; its truth is rounded to samples of pixels
FEW_PIXELS = 16  # covered area: coverage in steps of 1/9 leaves a centroid of so few pixels uncertain by about 0.1
LOST_TIP, LOST_SHARE = 6.0, 0.2
"""Pixels, or share of the box's longer side, that coverage may lack at an edge where parts are thinner than a third of
a pixel, the distance of rays: tapering tips, and rotor blades seen edge-on, which are lost whole."""
SIDES = (0.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, np.inf)
"""Bins of the shorter side of the projected box, pixels."""

BOX_CAUSES = {
    "occluded": f"less than {WHOLE:.0%} of the object is visible, so the mask shows a part of the projected box",
    "pixel grid": "every edge of the mask's box is within one pixel of the projected one: whole pixels around it",
    "mask threshold": "parts cover too little of a pixel for the mask, but the coverage image has them to within one",
    "between samples": f"parts thinner than rays lie apart; up to {LOST_TIP:g} pixels or {LOST_SHARE:.0%} lacks it",
    "unexplained": "none of the above",
}
RESIDUAL_CAUSES = {
    "occluded": "part of the object is hidden; its pixels at the hiding edge are shared",
    "perspective": "the image of a mean point is not the mean of the image where depths differ; within the bound "
    "residual <= half the box's diagonal * half of 1 m / distance, or confirmed by the depth image",
    "few pixels": f"fewer than {FEW_PIXELS} covered pixels",
    "unexplained": "none of the above",
}


@dataclass(frozen=True)
class Spread:
    """Median, 5th and 95th percentile of `count` values; NaN without any."""

    count: int
    median: float
    p5: float
    p95: float


@dataclass(frozen=True)
class Cause:
    """One cause of disagreement: views it accounts for, their share of those judged, and the median of what it did."""

    name: str
    meaning: str
    views: int
    share: float
    median: float


@dataclass(frozen=True)
class SideRow:
    """Agreement of views whose projected box's shorter side is within [low, high) pixels."""

    low: float
    high: float
    views: int
    iou: Spread
    iou_grid: Spread
    iou_subpixel: Spread
    residual: Spread


@dataclass(frozen=True)
class Consistency:
    """Table 6.4 of one rig. Residuals are pixels; a view is an object in one image.

    views: with the object in the mask. truncated: of those, how many show only part of it within the image; they are
        in the rows that say so and in no other.
    faint: views that only the coverage image shows, because the object fills no pixel enough for the mask.
    missed: views with the object's box in the image that neither shows.
    iou: mask's tight box against the projected box inside the image. iou_subpixel: box of the coverage instead.
    iou_grid: the projected box's own whole pixels instead, which is what a box of pixels can reach at this size.
    residual: projected centroid of the visible surface against the centroid of the silhouette.
    residual_depth: the same with pixels weighted by depth, which takes out the perspective exactly.
    origin: projected origin of the body against the centroid. origin_body: in metres at the object's distance.
    smoothness: largest step of a path over its mean step. at_rest: paths without a step.
    """

    rig: str
    views: int
    truncated: int
    faint: int
    missed: int
    iou: Spread
    iou_subpixel: Spread
    iou_grid: Spread
    iou_truncated: Spread
    residual: Spread
    residual_depth: Spread
    residual_truncated: Spread
    origin: Spread
    origin_body: Spread
    smoothness: Spread
    at_rest: int
    box_causes: tuple[Cause, ...]
    residual_causes: tuple[Cause, ...]
    by_side: tuple[SideRow, ...]


def spread(values: Float[np.ndarray, "*shape"]) -> Spread:
    """Spread of the values that are not NaN."""
    known = values[~np.isnan(values)]
    if not known.size:
        return Spread(0, np.nan, np.nan, np.nan)
    low, middle, high = (float(v) for v in np.percentile(known, (5, 50, 95)))
    return Spread(int(known.size), middle, low, high)


@dataclass(frozen=True, eq=False)
class _Errors:
    """Columns of one rig's views: overlaps and distances in pixels."""

    iou: np.ndarray
    subpixel: np.ndarray
    grid: np.ndarray
    residual: np.ndarray
    depth: np.ndarray
    origin: np.ndarray


def consistency(rig: str, views: Observations) -> Consistency:
    """Agreement of all views of a rig.

    Args:
        rig: name for the row.
        views: every object, frame and camera of its sequences, in view or not.
    """
    # A box with a pixel's area inside the image should have left something in the mask.
    inside = clip_boxes(np.nan_to_num(views.projected_box), views.size)
    expected = (inside[:, 2:] - inside[:, :2]).prod(axis=1) >= 1.0
    absent = expected & ~views.in_view & ~views.truncated & ~(views.visibility < WHOLE)
    seen = views.where(views.in_view)
    errors, cut = _errors(seen), seen.truncated
    whole = ~cut
    box_cause, residual_cause = box_causes(seen), residual_causes(seen)
    smooth, at_rest = smoothness(views)
    return Consistency(
        rig=rig,
        views=len(seen.area),
        truncated=int(cut.sum()),
        faint=int((absent & (views.covered > 0)).sum()),
        missed=int((absent & ~(views.covered > 0)).sum()),
        iou=spread(errors.iou[whole]),
        iou_subpixel=spread(errors.subpixel[whole]),
        iou_grid=spread(errors.grid[whole]),
        iou_truncated=spread(errors.iou[cut]),
        residual=spread(errors.residual[whole]),
        residual_depth=spread(errors.depth[whole]),
        residual_truncated=spread(errors.residual[cut]),
        origin=spread(errors.origin[whole]),
        origin_body=spread((errors.origin * seen.distance / seen.focal)[whole]),
        smoothness=spread(smooth),
        at_rest=at_rest,
        box_causes=_table(BOX_CAUSES, box_cause, errors.iou, whole & ~np.isnan(errors.iou)),
        residual_causes=_table(RESIDUAL_CAUSES, residual_cause, errors.residual, whole & ~np.isnan(errors.residual)),
        by_side=_by_side(seen, errors, whole),
    )


def _errors(views: Observations) -> _Errors:
    projected = clip_boxes(views.projected_box, views.size)
    return _Errors(
        iou=box_overlaps(views.mask_box, projected),
        subpixel=box_overlaps(views.covered_box, projected),
        grid=box_overlaps(np.concatenate([np.floor(projected[:, :2]), np.ceil(projected[:, 2:])], axis=1), projected),
        residual=np.linalg.norm(views.centroid - views.surface_pixel, axis=1),
        depth=np.linalg.norm(views.depth_centroid - views.surface_pixel, axis=1),
        origin=np.linalg.norm(views.centroid - views.origin_pixel, axis=1),
    )


def box_causes(views: Observations) -> np.ndarray:
    """By view, the cause of an overlap below `IOU_LIMIT`, or "" where there is nothing to explain."""
    projected = clip_boxes(views.projected_box, views.size)
    outward = np.array([-1.0, -1.0, 1.0, 1.0])
    beyond = (views.mask_box - projected) * outward  # by how much each edge of the mask lies outside, pixels
    sparse = (views.covered_box - projected) * outward
    lost = np.maximum(LOST_TIP, LOST_SHARE * (projected[:, 2:] - projected[:, :2]).max(axis=1))
    near = 1.001  # a pixel, and what rounding of floats adds
    found = np.select(
        [
            ~(box_overlaps(views.mask_box, projected) < IOU_LIMIT),
            views.visibility < WHOLE,
            (np.abs(beyond) <= near).all(axis=1),
            (np.abs(sparse) <= near).all(axis=1) & (beyond <= near).all(axis=1),
            (beyond <= near).all(axis=1) & ~(sparse < -lost[:, None]).any(axis=1),
        ],
        ["", "occluded", "pixel grid", "mask threshold", "between samples"],
        "unexplained",
    )
    return found


def perspective_bound(views: Observations) -> Float[np.ndarray, "view"]:
    """Largest distance in pixels between the image of a body's mean point and the mean of its image.

    With weights w the one is sum(w z u)/sum(w z), the other sum(w u)/sum(w); they differ by cov(u, z)/mean(z), which
    is at most sd(u) sd(z)/mean(z). A body of 1 m has sd(z) <= 0.5 m and sd(u) <= half its extent in the image
    (Popoviciu's inequality on variances).
    """
    diagonal = np.linalg.norm(views.mask_box[:, 2:] - views.mask_box[:, :2], axis=1)
    return 0.5 * diagonal * 0.5 / views.distance.clip(0.5)


def residual_causes(views: Observations) -> np.ndarray:
    """By view, the cause of a re-projection residual above `RESIDUAL_LIMIT`, or "" where there is none to explain."""
    errors = _errors(views)
    by_depth = errors.depth <= RESIDUAL_LIMIT
    possible = np.isnan(errors.depth) & (errors.residual <= perspective_bound(views))
    return np.select(
        [
            ~(errors.residual > RESIDUAL_LIMIT),
            by_depth | possible,
            views.visibility < WHOLE,
            ~(views.covered >= FEW_PIXELS) & ~(views.area >= FEW_PIXELS),
        ],
        ["", "perspective", "occluded", "few pixels"],
        "unexplained",
    )


def _table(
    meanings: dict[str, str], cause: np.ndarray, value: np.ndarray, judged: Bool[np.ndarray, "view"]
) -> tuple[Cause, ...]:
    total = max(int(judged.sum()), 1)
    rows = []
    for name, meaning in meanings.items():
        mine = judged & (cause == name)
        rows.append(Cause(name, meaning, int(mine.sum()), float(mine.sum() / total), spread(value[mine]).median))
    return tuple(rows)


def _by_side(views: Observations, errors: _Errors, whole: Bool[np.ndarray, "view"]) -> tuple[SideRow, ...]:
    side = (views.projected_box[:, 2:] - views.projected_box[:, :2]).min(axis=1)
    rows = []
    for low, high in itertools.pairwise(SIDES):
        mine = whole & (side >= low) & (side < high)
        if mine.any():
            parts = (spread(column[mine]) for column in (errors.iou, errors.grid, errors.subpixel, errors.residual))
            rows.append(SideRow(low, high, int(mine.sum()), *parts))
    return tuple(rows)


def smoothness(views: Observations) -> tuple[Float[np.ndarray, "path"], int]:
    """Largest step over mean step of every object's path, and how many objects rest (those have no value).

    max_t |X(t+1) - X(t)| / mean speed (thesis, section 6.3.3); X is the body's origin.
    """
    _, first = np.unique(np.stack([views.sequence, views.tracked, views.frame]), axis=1, return_index=True)
    order = first[np.lexsort((views.frame[first], views.tracked[first], views.sequence[first]))]
    key = views.sequence[order] * 1_000_000 + views.tracked[order]
    values, resting = [], 0
    for path in np.split(views.position[order], np.flatnonzero(np.diff(key)) + 1):
        steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
        moving = len(steps) > 0 and steps.mean() > 1e-9
        values += [float(steps.max() / steps.mean())] if moving else []
        resting += not moving
    return np.array(values, np.float64), resting
