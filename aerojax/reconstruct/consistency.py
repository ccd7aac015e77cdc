"""How well the cameras of one frame agree on the object: which one is off, by how many pixels and metres.

Three figures a camera, from what is cut out anyway:

ray: distance of its central ray from the point that the other cameras triangulate. Centres of outlines from two sides
    are not one point, so even perfect cameras leave some percent of the object's size.
shift: from the epipolar tangency constraint (Cipolla & Giblin 2000, ch. 5; Hernández et al. 2007): of the planes
    through two cameras' centres, those that touch the outline in one image touch it in the other, whatever the
    object's shape. How far apart they are is what calibration, clocks and masks are wrong.
uncovered: share of its silhouette that the re-projected reconstruction leaves bare; a visual hull lies inside every
    silhouette and fills it where all agree (Laurentini 1994).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float64

from aerojax.core.types import View

_GRAZING = 1.0
"""Object sizes that the line between two cameras must keep away from it: nearer, planes through it touch nothing."""


@dataclass(frozen=True, eq=False)
class Sightlines:
    """The cameras of one frame as seen from the object, in a frame with the rig's axes; metres.

    valid: cameras that count; what the arrays hold of the others means nothing.
    across: directions of two image axes, each perpendicular to the central ray.
    centre: the ray's offset along them from the point that all rays triangulate.
    distance: of the camera from that point.
    pixel: what one pixel of its image is worth at that point.
    size: the object's width, median over the cameras.
    """

    valid: Bool[np.ndarray, "camera"]
    across: Float64[np.ndarray, "camera 2 3"]
    centre: Float64[np.ndarray, "camera 2"]
    distance: Float64[np.ndarray, "camera"]
    pixel: Float64[np.ndarray, "camera"]
    size: float


@dataclass(frozen=True, eq=False)
class Tangency:
    """Two cameras' outlines between the planes through both their centres.

    first, second: indices of the cameras.
    normal: of the plane through both and the object; shifts are along it.
    ends: how much further the first camera's outline reaches than the second's, at its two ends, metres.
    """

    first: int
    second: int
    normal: Float64[np.ndarray, "3"]
    ends: tuple[float, float]

    @property
    def shift(self) -> float:
        """What both ends agree on: a rod or blade that one camera misses, and too wide masks, move one end alone."""
        a, b = self.ends
        return 0.0 if a * b <= 0 else float(np.sign(a) * min(abs(a), abs(b)))


@dataclass(frozen=True, eq=False)
class Consistency:
    """The figures of one frame; NaN where a camera does not count, or nothing can be said of it.

    ray_m, ray_px: of central rays, metres at the object and pixels of the camera's image.
    shift_m, shift_px: of outlines, median over the other cameras.
    uncovered: 0..1.
    lines, tangencies: what `Disagreement` adds up.
    """

    ray_m: Float64[np.ndarray, "camera"]
    ray_px: Float64[np.ndarray, "camera"]
    shift_m: Float64[np.ndarray, "camera"]
    shift_px: Float64[np.ndarray, "camera"]
    uncovered: Float64[np.ndarray, "camera"]
    lines: Sightlines
    tangencies: tuple[Tangency, ...]


def consistency(
    views: View,
    valid: Bool[np.ndarray, "camera"],
    focal: Float64[np.ndarray, "camera"],
    uncovered: Float64[np.ndarray, "camera"],
) -> Consistency:
    """How well the crops of one frame agree.

    Args:
        views: crops that look at the frame's origin, where their central rays meet best; metres.
        valid: cameras that count; those that show the whole object, at least one.
        focal: of the images that the crops were cut from, pixels.
        uncovered: from `uncovered_shares`.
    """
    masks = np.asarray(views.mask)
    K = np.asarray(views.camera.K, np.float64)
    pose = np.asarray(views.camera.world_from_cam, np.float64)
    outlines = [_outline(mask) if use else None for mask, use in zip(masks, valid, strict=True)]
    lines = _sightlines(outlines, K, pose, valid, focal)
    ray = _away_from_others(lines)
    tangencies = tuple(_tangencies(outlines, K, pose, lines))
    shift = np.array([_median_shift(tangencies, camera) for camera in range(len(valid))])
    return Consistency(ray, ray / lines.pixel, shift, shift / lines.pixel, uncovered, lines, tangencies)


def _outline(mask: Float[np.ndarray, "size size"]) -> Float64[np.ndarray, "corner 2"]:
    """Corners of the silhouette's convex hull, pixels: planes touch nothing else."""
    points = cv2.findNonZero((mask > min(0.5, 0.99 * float(mask.max()))).view(np.uint8))
    if points is None:  # a crop of nothing
        return np.full((1, 2), mask.shape[0] / 2)
    return cv2.convexHull(points)[:, 0].astype(np.float64) + 0.5


def _sightlines(
    outlines: Sequence[Float64[np.ndarray, "_ 2"] | None],
    K: Float64[np.ndarray, "camera 3 3"],
    pose: Float64[np.ndarray, "camera 4 4"],
    valid: Bool[np.ndarray, "camera"],
    focal: Float64[np.ndarray, "camera"],
) -> Sightlines:
    across = np.swapaxes(pose[:, :3, :2], 1, 2)
    place = pose[:, :3, 3]
    distance = np.linalg.norm(place, axis=1)
    sides = [
        np.ptp(outline, axis=0).max() * distance[i] / K[i, 0, 0]
        for i, outline in enumerate(outlines)
        if outline is not None
    ]
    centre, pixel = np.einsum("cak,ck->ca", across, place), distance / focal
    size = max(float(np.median(sides)), float(pixel[valid].min()))  # specks have a size, too
    return Sightlines(valid.copy(), across, centre, distance, pixel, size)


def _away_from_others(lines: Sightlines) -> Float64[np.ndarray, "camera"]:
    """Distance of each central ray from the point that the others triangulate; NaN for fewer than two others."""
    away = np.full(len(lines.valid), np.nan)
    for camera in np.flatnonzero(lines.valid):
        others = lines.valid.copy()
        others[camera] = False
        normal = np.einsum("cak,cal->kl", lines.across[others], lines.across[others])
        if others.sum() < 2 or np.linalg.cond(normal) > 1e8:
            continue
        point = np.linalg.solve(normal, np.einsum("cak,ca->k", lines.across[others], lines.centre[others]))
        away[camera] = np.linalg.norm(lines.centre[camera] - lines.across[camera] @ point)
    return away


def _tangencies(
    outlines: Sequence[Float64[np.ndarray, "_ 2"] | None],
    K: Float64[np.ndarray, "camera 3 3"],
    pose: Float64[np.ndarray, "camera 4 4"],
    lines: Sightlines,
) -> list[Tangency]:
    rays = [
        None if outline is None else np.c_[outline, np.ones(len(outline))] @ np.linalg.inv(K[i]).T @ pose[i, :3, :3].T
        for i, outline in enumerate(outlines)
    ]
    found = []
    for (i, a), (j, b) in itertools.combinations(((i, r) for i, r in enumerate(rays) if r is not None), 2):
        along = pose[j, :3, 3] - pose[i, :3, 3]
        length = np.linalg.norm(along)
        if length < 1e-9:
            continue
        along = along / length
        towards = -pose[i, :3, 3] + along * (along @ pose[i, :3, 3])  # from the line to the object, perpendicular
        away = float(np.linalg.norm(towards))
        if away < _GRAZING * lines.size:
            continue
        towards = towards / away
        normal = np.cross(along, towards)
        (low, high), (other_low, other_high) = (_reach(r, towards, normal, away) for r in (a, b))
        if np.isfinite([low, high, other_low, other_high]).all():
            found.append(Tangency(i, j, normal, (low - other_low, high - other_high)))
    return found


def _reach(rays: np.ndarray, towards: np.ndarray, normal: np.ndarray, away: float) -> tuple[float, float]:
    """Where the outermost planes of a pencil that touch an outline pass the object, metres from its middle."""
    forward = rays @ towards
    if forward.min() <= 0:
        return np.nan, np.nan
    height = away * (rays @ normal) / forward
    return float(height.min()), float(height.max())


def _median_shift(tangencies: Sequence[Tangency], camera: int) -> float:
    of_it = [abs(one.shift) for one in tangencies if camera in (one.first, one.second)]
    return float(np.median(of_it)) if of_it else np.nan


def uncovered_shares(
    views: View, valid: Bool[np.ndarray, "camera"], surface: Float[np.ndarray, "point 3"]
) -> Float64[np.ndarray, "camera"]:
    """Share of each silhouette that a reconstruction leaves bare, 0..1; NaN where a camera does not count.

    Args:
        views: crops that look at the frame's origin.
        valid: cameras that count.
        surface: points of the reconstruction, in the crops' frame; none where the silhouettes do not meet.
    """
    masks = np.asarray(views.mask)
    K = np.asarray(views.camera.K, np.float64)
    pose = np.asarray(views.camera.world_from_cam, np.float64)
    shares = np.full(len(valid), np.nan)
    for camera in np.flatnonzero(valid):
        shares[camera] = uncovered_share(masks[camera], surface, K[camera], pose[camera])
    return shares


def uncovered_share(
    mask: Float[np.ndarray, "size size"],
    surface: Float[np.ndarray, "point 3"],
    K: Float64[np.ndarray, "3 3"],
    world_from_cam: Float64[np.ndarray, "4 4"],
) -> float:
    """Share of a silhouette that points of a surface leave bare, 0..1.

    Points are drawn on cells of two pixels and spread by two cells, so that gaps between them are closed; what is
    counted lies at least that far outside.
    """
    side = mask.shape[0] // 2
    cells = cv2.resize(np.asarray(mask, np.float32), (side, side), interpolation=cv2.INTER_AREA)
    total = float(cells.sum())
    if total <= 0:
        return 1.0
    drawn = np.zeros((side, side), np.uint8)
    inside = (surface - world_from_cam[:3, 3]) @ world_from_cam[:3, :3]
    inside = inside[inside[:, 2] > 0]
    columns, rows = ((inside[:, a] / inside[:, 2] * K[a, a] + K[a, 2]) / 2 for a in (0, 1))
    kept = (columns >= 0) & (columns < side) & (rows >= 0) & (rows < side)
    drawn[rows[kept].astype(int), columns[kept].astype(int)] = 1
    spread = cv2.dilate(drawn, np.ones((5, 5), np.uint8))
    return float(cells[spread == 0].sum()) / total
