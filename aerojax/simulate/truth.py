"""What really flew, as `truth.json` has it: poses, joints, and what each camera saw of every object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from aerojax.capture.format import Capture, JointPose, ObjectState, TrackedObject
from aerojax.capture.frames import source_frame
from aerojax.geometry.boxes_3d import aligned_box, box_corners, oriented_box
from aerojax.geometry.cameras import project_points
from aerojax.geometry.rotations import quaternion_from_rotation
from aerojax.simulate.plan.scene import FlyingObject, ScenePlan
from aerojax.simulate.render.image import ObjectView
from aerojax.simulate.usd.animated_mesh import AnimatedMesh

Views = dict[tuple[str, int], tuple[ObjectView, ...]]
"""By camera's name and its own frame, what the image shows of every object."""


def tracked_object(index: int, plan: ScenePlan, mesh: AnimatedMesh, views: Views, capture: Capture) -> TrackedObject:
    """The truth of one object of a recorded scene.

    Args:
        index: of the object in the plan.
        plan: what was recorded.
        mesh: the object's asset.
        views: what was rendered.
        capture: its calibration and clocks decide which image belongs to which frame.
    """
    flown = plan.objects[index]
    flight = plan.shown(flown.flight)
    quaternions = _quaternions(flight.world_from_body)
    surface = _PosedSurface(flown, mesh, plan)
    states = []
    for frame, pose in enumerate(flight.transforms()):
        joints = _joints(mesh.joints_at(flown.phase + frame / plan.fps), pose)
        x, y, z = flight.position[frame].tolist()
        points, rotation = surface.at(float(frame))
        state = ObjectState(
            *(frame, (x, y, z), quaternions[frame], {}, {}),
            joints=joints,
            oriented_box=oriented_box(points, rotation),
            aligned_box=aligned_box(points),
            projected_corners=_corners(surface, frame, capture, plan),
        )
        states.append(_with_views(state, _seen(index, frame, views, capture)))
    identity = flown.identity
    return TrackedObject(index + 1, identity.label, identity.name, tuple(states), flown.source, flown.licence)


class _PosedSurface:
    """The vertices of an object that its faces use, at any moment of the capture; the last moment is kept."""

    def __init__(self, flown: FlyingObject, mesh: AnimatedMesh, plan: ScenePlan):
        self._flown, self._mesh, self._plan = flown, mesh, plan
        self._used = np.unique(mesh.faces)
        self._moment, self._last = np.nan, (np.zeros((0, 3)), np.eye(3))

    def at(self, moment: float) -> tuple[Float[np.ndarray, "point 3"], Float[np.ndarray, "3 3"]]:
        """Points (metres, world) and `world_from_body` at a frame number, which need not be whole."""
        if moment != self._moment:
            pose = self._flown.flight.transform_at(moment + self._plan.margin)
            vertices = self._mesh.vertices_at(self._flown.phase + moment / self._plan.fps)[self._used]
            points = vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
            self._moment, self._last = moment, (points, pose[:3, :3])
        return self._last


def _corners(
    surface: _PosedSurface, frame: int, capture: Capture, plan: ScenePlan
) -> dict[str, tuple[tuple[float, float], ...]]:
    """By camera, the projected corners of the box at the moment that its image for the capture's frame shows."""
    found = {}
    for number, camera in enumerate(plan.cameras):
        own = source_frame(capture, number, frame)
        if own is None:
            continue
        points, rotation = surface.at(own + camera.time_offset_s * plan.fps)
        pixels = project_points(box_corners(oriented_box(points, rotation), rotation), camera, behind=np.nan)
        if not np.isnan(pixels).any():
            found[camera.name] = tuple((u, v) for u, v in pixels.tolist())
    return found


def _seen(index: int, frame: int, views: Views, capture: Capture) -> dict[str, ObjectView]:
    """By camera, what its image for the capture's frame shows: the one that its clock brings nearest."""
    found = {}
    for number, camera in enumerate(capture.cameras):
        own = source_frame(capture, number, frame)
        if own is not None:
            found[camera.name] = views[camera.name, own][index]
    return found


def _with_views(state: ObjectState, seen: Mapping[str, ObjectView]) -> ObjectState:
    return replace(
        state,
        bbox={name: view.box for name, view in seen.items() if view.box is not None},
        visible={name: view.box is not None for name, view in seen.items()},
        truncated={name: view.truncated for name, view in seen.items()},
        visibility={name: min(1.0, view.visibility) for name, view in seen.items()},
        visible_box={name: view.visible_box for name, view in seen.items() if view.visible_box is not None},
        projected_box={name: view.projected_box for name, view in seen.items() if view.projected_box is not None},
        surface_centroid={n: view.surface_centroid for n, view in seen.items() if view.surface_centroid is not None},
    )


def _quaternions(rotations: Float[np.ndarray, "time 3 3"]) -> list[tuple[float, float, float, float]]:
    with jax.enable_x64(True):
        values = np.asarray(quaternion_from_rotation(jnp.asarray(rotations)))
    return [(w, x, y, z) for w, x, y, z in values.tolist()]


def _joints(
    body_from_joint: Mapping[str, Float[np.ndarray, "4 4"]], world_from_body: Float[np.ndarray, "4 4"]
) -> dict[str, JointPose]:
    if not body_from_joint:
        return {}
    poses = world_from_body @ np.stack(list(body_from_joint.values()))
    quaternions = _quaternions(np.ascontiguousarray(poses[:, :3, :3]))
    positions = [(x, y, z) for x, y, z in poses[:, :3, 3].tolist()]
    return {n: JointPose(p, q) for n, p, q in zip(body_from_joint, positions, quaternions, strict=True)}
