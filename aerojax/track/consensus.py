"""Which part of each camera's mask is the object: the one whose ray meets those of the other cameras."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import Silhouette
from aerojax.geometry.cameras import pixel_rays, points_in_camera, project_points
from aerojax.track.parts import Part, parts_of

OFF = 0.5
"""How far a part's centre may be from where the others see the object, in diagonals of its box: outlines differ."""
OFF_PIXELS = 3.0
"""And in pixels, for what the calibration may be wrong."""
MOST_UNEQUAL = 6.0
"""Sizes of one object from two sides differ by less, in metres; a stray pixel is as good as a point."""


@dataclass(frozen=True, eq=False)
class _Meeting:
    """Parts, at most one a camera, that see one point, and how well: cameras first, then pixels."""

    parts: dict[int, Part]
    point: Float64[np.ndarray, "3"]
    size: float

    @property
    def score(self) -> tuple[int, int]:
        return len(self.parts), sum(part.area for part in self.parts.values())


def agreed(silhouettes: Sequence[Silhouette], cameras: Sequence[CaptureCamera]) -> list[Silhouette]:
    """Silhouettes without what is not the object: stray pixels, specks and other things far away.

    Where all masks are of one part each and of like size, nothing is looked for and nothing changes. Otherwise, of all
    pairs of parts in two cameras, the one is taken whose meeting point most cameras see a part at; each camera keeps
    that part. A camera with several parts but none there keeps its largest where fewer than three cameras agree, and
    none otherwise; one with a single part keeps it, unless it is a speck beside what the others see.

    Args:
        silhouettes: of one object, at most one a camera.
        cameras: of the network.
    """
    parts = {one.camera: found for one in silhouettes if (found := parts_of(one))}
    if all(len(found) == 1 for found in parts.values()) and not _are_unequal([found[0] for found in parts.values()]):
        return list(silhouettes)
    best = _best_meeting(parts, cameras)
    kept = {camera: _kept(camera, found, best, cameras) for camera, found in parts.items()}
    return [
        one if len(parts[one.camera]) == 1 else part.silhouette()
        for one in silhouettes
        if (part := kept.get(one.camera)) is not None
    ]


def _kept(camera: int, parts: list[Part], best: _Meeting | None, cameras: Sequence[CaptureCamera]) -> Part | None:
    if best is None or len(best.parts) < 3:
        return parts[0]
    if camera in best.parts:
        return best.parts[camera]
    if len(parts) > 1 or _size(parts[0], cameras[camera], best.point) * MOST_UNEQUAL < best.size:
        return None
    return parts[0]


def _are_unequal(parts: Sequence[Part]) -> bool:
    """Whether a part is so small beside the others that it may be a speck."""
    diagonals = [_diagonal(part) for part in parts]
    return len(parts) > 3 and min(diagonals) * MOST_UNEQUAL < float(np.median(diagonals))


def _best_meeting(parts: dict[int, list[Part]], cameras: Sequence[CaptureCamera]) -> _Meeting | None:
    meetings = (
        _meeting(one, other, parts, cameras)
        for first, second in itertools.combinations(parts, 2)
        for one, other in itertools.product(parts[first], parts[second])
    )
    return max((m for m in meetings if m is not None), key=lambda m: m.score, default=None)


def _meeting(one: Part, other: Part, parts: dict[int, list[Part]], cameras: Sequence[CaptureCamera]) -> _Meeting | None:
    """What all cameras see where the rays of two parts meet; None where they do not."""
    point = _between(one, other, cameras)
    if point is None:
        return None
    size = float(np.sqrt(np.prod([_size(p, cameras[p.of.camera], point) for p in (one, other)])))
    seen = {}
    for camera, candidates in parts.items():
        held = (p for p in candidates if camera not in (one.of.camera, other.of.camera) or p in (one, other))
        fitting = [p for p in held if _fits(p, cameras[camera], point, size)]
        if fitting:
            seen[camera] = max(fitting, key=lambda part: part.area)
    if one.of.camera not in seen or other.of.camera not in seen:
        return None
    return _Meeting(seen, point, size)


def _between(one: Part, other: Part, cameras: Sequence[CaptureCamera]) -> Float64[np.ndarray, "3"] | None:
    """The point nearest to two rays; None where they are parallel."""
    seen = [(part, cameras[part.of.camera]) for part in (one, other)]
    origins = np.stack([camera.world_from_cam[:3, 3] for _, camera in seen])
    directions = np.stack([pixel_rays(_centre(part), camera) for part, camera in seen])
    projectors = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    normal = projectors.sum(axis=0)
    if np.linalg.cond(normal) > 1e9:
        return None
    anchor = origins.mean(axis=0)
    return np.linalg.solve(normal, np.einsum("rij,rj->i", projectors, origins - anchor)) + anchor


def _fits(part: Part, camera: CaptureCamera, point: Float64[np.ndarray, "3"], size: float) -> bool:
    if points_in_camera(point, camera)[2] <= 0:
        return False
    off = float(np.linalg.norm(project_points(point, camera) - _centre(part)))
    own = _size(part, camera, point)
    near = off <= OFF * _diagonal(part) + OFF_PIXELS
    return near and own <= MOST_UNEQUAL * size and size <= MOST_UNEQUAL * own


def _size(part: Part, camera: CaptureCamera, point: Float64[np.ndarray, "3"]) -> float:
    """Length of the part's diagonal at a point's depth, metres; next to nothing behind the camera."""
    depth = max(float(points_in_camera(point, camera)[2]), 1e-9)
    return _diagonal(part) * depth / float(camera.K[0, 0])


def _diagonal(part: Part) -> float:
    return float(np.hypot(part.box[2] - part.box[0], part.box[3] - part.box[1]))


def _centre(part: Part) -> Float64[np.ndarray, "2"]:
    return np.array([(part.box[0] + part.box[2]) / 2, (part.box[1] + part.box[3]) / 2])
