"""Truth of a Replicator recording: boxes from its masks, poses from its 3D boxes or, without them, from what was seen.

Where no 3D boxes were recorded, a position is the mean of the visible surface (with depth) or the point nearest to the
rays through the masks' centroids, and orientations are unknown and written as identity; the object's `source` says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float32, Float64

from aerojax.capture.format import CaptureCamera
from aerojax.capture.imports.recording import BrokenFile, RecordedCamera, read_array, read_json
from aerojax.capture.imports.replicator_camera import Z_UP_FROM, UpAxis
from aerojax.capture.imports.replicator_objects import FlyingPrims
from aerojax.capture.truth import ObjectState, Quaternion, TrackedObject
from aerojax.geometry.boxes import Box, tight_box, touches_border
from aerojax.geometry.cameras import pixel_rays, unproject_depth
from aerojax.geometry.rotations import quaternion_from_rotation
from aerojax.geometry.triangulation import intersect_rays

_IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
_RECORDED = "Isaac Replicator recording, poses from its 3D boxes"
_ESTIMATED = "Isaac Replicator recording; positions are estimated from masks and depth, orientations are unknown"

Poses = dict[int, dict[int, Float64[np.ndarray, "4 4"]]]
"""World from body in metres, by object id and frame."""


@dataclass(frozen=True, eq=False)
class Sight:
    """One object in one image: its box, number of pixels, and in the world its ray and mean surface point.

    surface: mean of the unprojected pixels, or None without depth.
    """

    box: Box
    truncated: bool
    pixels: int
    ray: Float64[np.ndarray, "3"]
    surface: Float64[np.ndarray, "3"] | None


def look_at_object(
    pixels: Bool[np.ndarray, "height width"], depth: Float32[np.ndarray, "height width"] | None, camera: CaptureCamera
) -> Sight | None:
    """What one image says of one object; None where it is not in it."""
    box = tight_box(pixels)
    if box is None:
        return None
    rows, columns = np.nonzero(pixels)
    seen = np.stack([columns + 0.5, rows + 0.5], axis=1)
    surface = None
    if depth is not None and np.any(depth[pixels] > 0):
        known = depth[pixels] > 0
        surface = unproject_depth(seen[known], depth[pixels][known], camera).mean(axis=0)
    cut = touches_border(box, camera.width, camera.height)
    return Sight(box, cut, len(rows), pixel_rays(seen.mean(axis=0), camera), surface)


def read_poses(
    camera: RecordedCamera, frame: int, flying: FlyingPrims, up: UpAxis, unit: float
) -> dict[int, Float64[np.ndarray, "4 4"]]:
    """Poses of one frame from bounding_box_3d, by object id; empty without it.

    Its transforms act on row vectors, in stage units.

    Raises:
        BrokenFile: the boxes are malformed.
    """
    path, names_path = camera.at("bounding_box_3d", frame), camera.at("bounding_box_3d_prim_paths", frame)
    if path is None or names_path is None:
        return {}
    rows, names = read_array(path), read_json(names_path)
    if rows.dtype.names is None or "transform" not in rows.dtype.names or rows.dtype["transform"].shape != (4, 4):
        raise BrokenFile(path, "has no field `transform` of 4×4 numbers")
    if not isinstance(names, list) or len(names) != len(rows):
        raise BrokenFile(names_path, f"does not name the {len(rows)} boxes beside it")
    poses: dict[int, Float64[np.ndarray, "4 4"]] = {}
    for row, prim in zip(rows["transform"].astype(np.float64), names, strict=True):
        number = flying.object_id(prim) if isinstance(prim, str) else None
        if number is not None:
            poses[number] = _rigid(row, up, unit)
    return poses


def _rigid(row_matrix: Float64[np.ndarray, "4 4"], up: UpAxis, unit: float) -> Float64[np.ndarray, "4 4"]:
    pose, turn = np.eye(4), Z_UP_FROM[up]
    lengths = np.linalg.norm(row_matrix[:3, :3], axis=1, keepdims=True)  # the prim's scale, which is no pose
    pose[:3, :3] = turn @ (row_matrix[:3, :3] / np.maximum(lengths, 1e-12)).T
    pose[:3, 3] = turn @ row_matrix[3, :3] * unit
    return pose


Sights = Mapping[tuple[int, int], Mapping[str, Sight]]
"""Sights of (object id, frame) by camera."""


def tracked_objects(
    flying: FlyingPrims, sights: Sights, poses: Poses, cameras: Sequence[CaptureCamera], frames: int
) -> tuple[TrackedObject, ...]:
    """Objects that at least one image shows, with a state a frame."""
    objects = []
    for number, (prim, label) in enumerate(flying.classes.items(), start=1):
        mine = [sights.get((number, frame), {}) for frame in range(frames)]
        recorded = poses.get(number, {})
        if not any(mine):
            continue
        places = _positions(mine, recorded, cameras)
        states = tuple(
            _state(frame, places[frame], recorded.get(frame), seen, cameras) for frame, seen in enumerate(mine)
        )
        source = _RECORDED if len(recorded) == frames else _ESTIMATED
        objects.append(TrackedObject(number, label, prim.rsplit("/", 1)[-1] or prim, states, source=source))
    return tuple(objects)


def _positions(
    seen: list[Mapping[str, Sight]],
    recorded: Mapping[int, Float64[np.ndarray, "4 4"]],
    cameras: Sequence[CaptureCamera],
) -> Float64[np.ndarray, "time 3"]:
    """Recorded or estimated positions; frames without either lie on the line between their neighbours."""
    known = {frame: pose[:3, 3] for frame, pose in recorded.items()}
    for frame, by_camera in enumerate(seen):
        place = None if frame in known else _estimate(by_camera, cameras)
        if place is not None:
            known[frame] = place
    if not known:  # one camera's silhouettes and no depth: a point on its ray is all that can be said
        by_camera = next(each for each in seen if each)
        name, sight = next(iter(by_camera.items()))
        known[0] = next(c for c in cameras if c.name == name).world_from_cam[:3, 3] + sight.ray
    frames = sorted(known)
    points = np.stack([known[frame] for frame in frames])
    times = np.arange(len(seen))
    return np.stack([np.interp(times, frames, points[:, axis]) for axis in range(3)], axis=1)


def _estimate(seen: Mapping[str, Sight], cameras: Sequence[CaptureCamera]) -> Float64[np.ndarray, "3"] | None:
    surfaces = [(sight.surface, sight.pixels) for sight in seen.values() if sight.surface is not None]
    if surfaces:
        points, weights = np.stack([p for p, _ in surfaces]), np.array([float(n) for _, n in surfaces])
        return np.average(points, axis=0, weights=weights)
    if len(seen) < 2:
        return None
    centres = np.stack([c.world_from_cam[:3, 3] for c in cameras if c.name in seen])
    rays = np.stack([seen[c.name].ray for c in cameras if c.name in seen])
    with jax.enable_x64(True):
        return np.asarray(intersect_rays(jnp.asarray(centres), jnp.asarray(rays)))


def _state(
    frame: int,
    place: Float64[np.ndarray, "3"],
    pose: Float64[np.ndarray, "4 4"] | None,
    seen: Mapping[str, Sight],
    cameras: Sequence[CaptureCamera],
) -> ObjectState:
    x, y, z = place.tolist()
    return ObjectState(
        frame=frame,
        position=(x, y, z),
        orientation_wxyz=_IDENTITY if pose is None else _quaternion(pose),
        bbox={name: sight.box for name, sight in seen.items()},
        visible={camera.name: camera.name in seen for camera in cameras},
        truncated={name: sight.truncated for name, sight in seen.items()},
    )


def _quaternion(pose: Float64[np.ndarray, "4 4"]) -> Quaternion:
    with jax.enable_x64(True):
        w, x, y, z = np.asarray(quaternion_from_rotation(jnp.asarray(pose[:3, :3]))).tolist()
    return w, x, y, z
