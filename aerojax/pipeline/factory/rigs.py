"""Cameras of a clip: layouts about the object, then the focal length that shows it as large as was drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from aerojax.capture.format import CaptureCamera
from aerojax.geometry.boxes import projected_box
from aerojax.pipeline.factory.config import RigRanges, log_uniform, uniform
from aerojax.simulate.world.rigs import aimed_camera

_ASPECTS = (9 / 16, 2 / 3, 3 / 4)
"""Height of an image over its width."""
_UNIT = 1000.0
"""Pixels: the focal length that the object's size is measured with."""
_SMALLEST = 4.0
"""Least width of an image over that of the object in it."""


def draw_cameras(
    kind: str,
    ranges: RigRanges,
    target: Float[np.ndarray, "3"],
    vertices: Float[np.ndarray, "vertex 3"],
    field: float,
    rng: np.random.Generator,
) -> tuple[CaptureCamera, ...]:
    """Cameras about a target.

    Args:
        kind: of `KINDS`.
        ranges: of the other draws.
        target: middle of the flight, metres, world.
        vertices: of the object there, metres, world; their projections decide the focal length.
        field: horizontal field of view, radians.
        rng: source of every draw.
    """
    count = int(rng.integers(ranges.cameras[0], ranges.cameras[1] + 1))
    places = _LAYOUTS[kind](count, ranges, rng)
    places = places * (log_uniform(rng, ranges.distance_m) / np.median(np.linalg.norm(places, axis=1)))
    nearest = np.linalg.norm(places, axis=1).min()
    past = rng.uniform(-1.0, 1.0, (count, 3)) * ranges.off_centre * np.tan(field / 2) * nearest / np.sqrt(3.0)
    if kind != "free":
        past = np.repeat(past[:1], count, axis=0)  # one point that all look at
    factors = np.exp(rng.uniform(-0.3, 0.3, count)) if kind == "free" else np.ones(count)
    aspect = _ASPECTS[rng.integers(len(_ASPECTS))]
    unit = [_camera(i, target, places[i], past[i], _UNIT * factors[i]) for i in range(count)]
    wanted = log_uniform(rng, ranges.width_px)
    scale = wanted / np.median([_longer_side(vertices, camera) for camera in unit])
    roll = _rolls(count, ranges, rng)
    return tuple(
        _rolled(_zoomed(camera, scale, field, wanted, aspect, ranges), turn)
        for camera, turn in zip(unit, roll, strict=True)
    )


def _camera(index: int, target: np.ndarray, place: np.ndarray, past: np.ndarray, focal: float) -> CaptureCamera:
    return aimed_camera(index, target + place, target + past, focal=focal, size=(2, 2))


def _longer_side(vertices: np.ndarray, camera: CaptureCamera) -> float:
    box = projected_box(vertices, camera)
    return np.inf if box is None else max(box[2] - box[0], box[3] - box[1])


def _zoomed(
    camera: CaptureCamera, scale: float, field: float, wanted: float, aspect: float, ranges: RigRanges
) -> CaptureCamera:
    focal = float(camera.K[0, 0]) * scale
    width = int(np.clip(2.0 * focal * np.tan(field / 2), _SMALLEST * wanted, ranges.most_pixels))
    height = int(width * aspect)
    K = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
    return replace(camera, width=width, height=height, K=K)


def _rolls(count: int, ranges: RigRanges, rng: np.random.Generator) -> np.ndarray:
    largest, turns = np.deg2rad(uniform(rng, ranges.roll_deg)), rng.uniform(-1.0, 1.0, count)
    return np.zeros(count) if rng.uniform() < ranges.level else largest * turns


def _rolled(camera: CaptureCamera, turn: float) -> CaptureCamera:
    pose, c, s = camera.world_from_cam.copy(), np.cos(turn), np.sin(turn)
    pose[:3, :3] = pose[:3, :3] @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return replace(camera, world_from_cam=pose)


def _towards(azimuth: np.ndarray, elevation: np.ndarray) -> Float[np.ndarray, "camera 3"]:
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=1)


def _around(count: int, rng: np.random.Generator) -> np.ndarray:
    """Azimuths all around, each somewhere within half of its share."""
    share = 2 * np.pi / count
    return rng.uniform(0.0, 2 * np.pi) + share * (np.arange(count) + rng.uniform(-0.25, 0.25, count))


def _sphere(count: int, ranges: RigRanges, rng: np.random.Generator) -> Float[np.ndarray, "camera 3"]:
    """At one distance; all at one elevation as in Sim-1, or each at its own."""
    own, one = rng.uniform(*ranges.elevation_deg, count), rng.uniform(*ranges.elevation_deg)
    elevation = np.full(count, one) if rng.uniform() < 0.5 else own
    return _towards(_around(count, rng), np.deg2rad(elevation))


def _circle(count: int, ranges: RigRanges, rng: np.random.Generator) -> Float[np.ndarray, "camera 3"]:
    """At one height on a circle, the object somewhere in it as in Sim-2."""
    around = _around(count, rng)
    height = np.tan(np.deg2rad(rng.uniform(*ranges.elevation_deg)))
    aside, way = 0.4 * np.sqrt(rng.uniform()), rng.uniform(0.0, 2 * np.pi)
    ring = np.stack([np.cos(around), np.sin(around), np.full(count, height)], axis=1)
    return ring - aside * np.array([np.cos(way), np.sin(way), 0.0])


def _line(count: int, ranges: RigRanges, rng: np.random.Generator) -> Float[np.ndarray, "camera 3"]:
    """Evenly on a straight level base before which the object is, not always in the middle, as in Sim-3."""
    half = np.tan(np.deg2rad(log_uniform(rng, ranges.line_half_angle_deg)))
    side = np.linspace(-half, half, count) + rng.uniform(-1.0, 1.0) * half
    way, up = rng.uniform(0.0, 2 * np.pi), np.tan(np.deg2rad(rng.uniform(*ranges.line_elevation_deg)))
    c, s = np.cos(way), np.sin(way)
    return np.stack([c - side * s, s + side * c, np.full(count, up)], axis=1)


def _free(count: int, ranges: RigRanges, rng: np.random.Generator) -> Float[np.ndarray, "camera 3"]:
    """Every camera somewhere, at its own distance."""
    elevation = np.deg2rad(rng.uniform(*ranges.elevation_deg, count))
    directions = _towards(rng.uniform(0.0, 2 * np.pi, count), elevation)
    return directions * np.exp(rng.uniform(-0.5, 0.5, (count, 1)))


_LAYOUTS = {"sphere": _sphere, "circle": _circle, "line": _line, "free": _free}
"""Places relative to the object, to be scaled to the drawn distance."""
