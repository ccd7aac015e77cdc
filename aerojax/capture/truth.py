"""What really flew: objects, where they were, how each camera saw them; to and from `truth.json`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from aerojax.core.types import Box
from aerojax.geometry.boxes_3d import AlignedBox, OrientedBox
from aerojax.geometry.rotations import quaternion_from_rotation, quaternion_multiply

Point = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Pixel = tuple[float, float]


@dataclass(frozen=True)
class JointPose:
    """A joint of an object's skeleton: position (metres) and unit quaternion w x y z, both in the world frame."""

    position: Point
    orientation_wxyz: Quaternion


@dataclass(frozen=True)
class ObjectState:
    """Where one object is in one frame, and how the cameras see it. Boxes are pixels of the undistorted image.

    frame: index in the capture.
    position: the body's origin, metres, world frame.
    orientation_wxyz: unit quaternion, world from body.
    bbox: by camera name, the tight box x0 y0 x1 y1 of the mask, ends exclusive.
    visible: by camera name; a camera that is absent does not see the object.
    truncated: by camera name, whether the object reaches beyond the image.
    visibility: by camera name, visible pixels over the pixels that the object would have alone, 0..1.
    visible_box: by camera name, around what is visible, to a fraction of a pixel.
    projected_box: by camera name, x0 y0 x1 y1 of the projected vertices, not clipped to the image.
    surface_centroid: by camera name, mean of the visible surface points weighted by coverage, metres, world frame.
    joints: by name, the skeleton's pose.
    oriented_box: around the whole surface along the body's axes (those of `orientation_wxyz`), or None.
    aligned_box: around the same along the world's axes, or None.
    projected_corners: by camera name, the eight corners of `oriented_box` in pixels, not clipped to the image, in the
        order of `geometry.boxes_3d.CORNER_SIGNS`; a camera with any of them behind it is absent.
    """

    frame: int
    position: Point
    orientation_wxyz: Quaternion
    bbox: Mapping[str, Box]
    visible: Mapping[str, bool]
    truncated: Mapping[str, bool] = field(default_factory=dict)
    visibility: Mapping[str, float] = field(default_factory=dict)
    visible_box: Mapping[str, Box] = field(default_factory=dict)
    projected_box: Mapping[str, Box] = field(default_factory=dict)
    surface_centroid: Mapping[str, Point] = field(default_factory=dict)
    joints: Mapping[str, JointPose] = field(default_factory=dict)
    oriented_box: OrientedBox | None = None
    aligned_box: AlignedBox | None = None
    projected_corners: Mapping[str, tuple[Pixel, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class TrackedObject:
    """One object of the truth; `object_id` is its value in the masks, `frames` are sorted and complete.

    gaussians: pattern of PLY files of Gaussians on its surface, world frame, relative to the capture's folder, or None.
    """

    object_id: int
    class_name: str
    identity: str
    frames: tuple[ObjectState, ...]
    source: str | None = None
    licence: str | None = None
    gaussians: str | None = None


@dataclass(frozen=True)
class Truth:
    """What really flew."""

    objects: tuple[TrackedObject, ...]


def truth_from_json(raw: dict[str, Any]) -> Truth:
    """The truth of a parsed file that was found to be in order."""
    return Truth(
        tuple(
            TrackedObject(
                object_id=item["id"],
                class_name=item["class"],
                identity=item["identity"],
                frames=tuple(sorted(map(_state_from_json, item["frames"]), key=lambda state: state.frame)),
                source=item.get("source"),
                licence=item.get("licence"),
                gaussians=item.get("gaussians"),
            )
            for item in raw["objects"]
        )
    )


def _state_from_json(raw: dict[str, Any]) -> ObjectState:
    return ObjectState(
        frame=raw["frame"],
        position=_point(raw["position"]),
        orientation_wxyz=_four(raw["orientation_wxyz"]),
        bbox=_four_each(raw["bbox"]),
        visible=dict(raw["visible"]),
        truncated=dict(raw.get("truncated", {})),
        visibility={camera: float(share) for camera, share in raw.get("visibility", {}).items()},
        visible_box=_four_each(raw.get("visible_box", {})),
        projected_box=_four_each(raw.get("projected_box", {})),
        surface_centroid={camera: _point(p) for camera, p in raw.get("surface_centroid", {}).items()},
        joints={
            name: JointPose(_point(joint["position"]), _four(joint["orientation_wxyz"]))
            for name, joint in raw.get("joints", {}).items()
        },
        **_boxes_3d(raw),
    )


def _boxes_3d(raw: dict[str, Any]) -> dict[str, Any]:
    """The fields of a state that concern boxes in space."""
    oriented, aligned = raw.get("oriented_box"), raw.get("aligned_box")
    return {
        "oriented_box": oriented and OrientedBox(_point(oriented["centre"]), _point(oriented["size"])),
        "aligned_box": aligned and AlignedBox(_point(aligned["low"]), _point(aligned["high"])),
        "projected_corners": {
            camera: tuple((float(u), float(v)) for u, v in corners)
            for camera, corners in raw.get("projected_corners", {}).items()
        },
    }


def _point(values: list[Any]) -> Point:
    x, y, z = (float(v) for v in values)
    return x, y, z


def _four(values: list[Any]) -> tuple[float, float, float, float]:
    a, b, c, d = (float(v) for v in values)
    return a, b, c, d


def _four_each(values: dict[str, list[Any]]) -> dict[str, Box]:
    return {camera: _four(box) for camera, box in values.items()}


_OPTIONAL = (
    *("truncated", "visibility", "visible_box", "projected_box", "surface_centroid", "joints"),
    *("oriented_box", "aligned_box", "projected_corners"),
)


def truth_to_json(truth: Truth) -> dict[str, Any]:
    """The contents of `truth.json`; optional fields that are empty are left out."""
    return {"objects": [_object_to_json(item) for item in truth.objects]}


def _object_to_json(item: TrackedObject) -> dict[str, Any]:
    optional = {"source": item.source, "licence": item.licence, "gaussians": item.gaussians}
    return {
        "id": item.object_id,
        "class": item.class_name,
        "identity": item.identity,
        **{key: value for key, value in optional.items() if value is not None},
        "frames": [_state_to_json(state) for state in item.frames],
    }


def _state_to_json(state: ObjectState) -> dict[str, Any]:
    raw = dataclasses.asdict(state)
    return {key: value for key, value in raw.items() if value or key not in _OPTIONAL}


def rotate_truth(truth: Truth, rotation: Float64[np.ndarray, "3 3"]) -> Truth:
    """The same truth in a turned world, x' = R x; what is measured in pixels stays.

    Boxes along the world's axes are left out, for the truth does not say which is the smallest there, and files of
    Gaussians, which are in the world as it was.
    """
    return Truth(
        tuple(
            dataclasses.replace(item, frames=_rotate_states(item.frames, rotation), gaussians=None)
            for item in truth.objects
        )
    )


def _rotate_states(states: tuple[ObjectState, ...], rotation: Float64[np.ndarray, "3 3"]) -> tuple[ObjectState, ...]:
    joints = [joint for state in states for joint in state.joints.values()]
    positions = iter(_rotate_points([s.position for s in states] + [j.position for j in joints], rotation))
    turned = iter(_rotate_quaternions([s.orientation_wxyz for s in states + tuple(joints)], rotation))
    bodies = [(next(positions), next(turned)) for _ in states]
    skeleton = [JointPose(next(positions), next(turned)) for _ in joints]
    centroids = iter(_rotate_points([p for state in states for p in state.surface_centroid.values()], rotation))
    following = iter(skeleton)
    boxes = iter(_rotate_points([s.oriented_box.centre for s in states if s.oriented_box is not None], rotation))
    return tuple(
        dataclasses.replace(
            state,
            position=position,
            orientation_wxyz=quaternion,
            joints={name: next(following) for name in state.joints},
            surface_centroid={camera: next(centroids) for camera in state.surface_centroid},
            oriented_box=state.oriented_box and OrientedBox(next(boxes), state.oriented_box.size),
            aligned_box=None,
        )
        for state, (position, quaternion) in zip(states, bodies, strict=True)
    )


def _rotate_points(points: list[Point], rotation: Float64[np.ndarray, "3 3"]) -> list[Point]:
    return [_point(p) for p in (np.array(points).reshape(-1, 3) @ rotation.T).tolist()]


def _rotate_quaternions(quaternions: list[Quaternion], rotation: Float64[np.ndarray, "3 3"]) -> list[Quaternion]:
    if not quaternions:
        return []
    with jax.enable_x64(True):  # the truth is in double precision and stays so
        turn = quaternion_from_rotation(jnp.asarray(rotation))
        before = jnp.asarray(np.array(quaternions))
        after = np.asarray(quaternion_multiply(jnp.broadcast_to(turn, before.shape), before))
    return [_four(q) for q in after.tolist()]
