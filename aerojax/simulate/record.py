"""A planned scene to disk: every camera's images of every frame, the stage, and what really flew."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, UInt8
from scipy.spatial.transform import Rotation, Slerp

from aerojax.capture.format import (
    Capture,
    CaptureCamera,
    JointPose,
    ObjectState,
    TrackedObject,
    Truth,
    write_capture_json,
)
from aerojax.capture.frames import source_frame
from aerojax.capture.write import FrameExtras, Placement, write_frame
from aerojax.geometry.rotations import quaternion_from_rotation
from aerojax.simulate.assets.catalogue import Identity
from aerojax.simulate.render.image import ImageConfig, ObjectView, Rendering
from aerojax.simulate.render.scene import Environment, SceneRenderer
from aerojax.simulate.usd.animated_mesh import AnimatedMesh, load_animated_mesh
from aerojax.simulate.usd.sequence_stage import StagedObject, author_stage, poses_of, write_scenery
from aerojax.simulate.world.flight import Flight
from aerojax.simulate.world.sensor import SensorConfig, expose, through_shutter
from kernels.rays.landscape import LandscapeMesh

ASSET_LICENCE = "Apache-2.0"


@dataclass(frozen=True)
class Actor:
    """One flying object of a scene.

    identity: what flies. stage: its USD file.
    flight: poses in the world, `ScenePlan.margin` frames longer than the capture at both ends.
    phase: where in its cycle the asset's animation is at time 0, seconds.
    source, licence: of the model, for the truth.
    """

    identity: Identity
    stage: Path
    flight: Flight
    phase: float
    source: str = "aerojax"
    licence: str = ASSET_LICENCE


@dataclass(frozen=True)
class ScenePlan:
    """Everything that is decided before the first ray.

    actors: their mask values are 1, 2 … in this order.
    cameras: as they stand, with the patterns of the images to write and their clocks' offsets.
    calibration: the same cameras as the capture's user is told.
    environment: dome or landscape, and its light.
    images: what is rendered.
    frames, fps: length and rate.
    margin: frames by which flights are longer at either end: for the next pose of the last frame and for late clocks.
    sensors: one a camera; ideal ones if empty.
    noise_seed: of the sensors' noise.
    landscape: what the environment shows, for the scene's stage; None before a dome.
    """

    actors: tuple[Actor, ...]
    cameras: tuple[CaptureCamera, ...]
    calibration: tuple[CaptureCamera, ...]
    environment: Environment
    images: ImageConfig
    frames: int
    fps: float
    margin: int = 0
    sensors: tuple[SensorConfig, ...] = ()
    noise_seed: int = 0
    landscape: LandscapeMesh | None = None


@dataclass
class Costs:
    """Seconds spent on posing, casting and writing, and images written."""

    simulate: float = 0.0
    cast: float = 0.0
    write: float = 0.0
    images: int = 0


Views = dict[tuple[str, int], tuple[ObjectView, ...]]
"""What a camera's own frame shows of every object."""


def image_patterns(camera: CaptureCamera, images: ImageConfig) -> CaptureCamera:
    """The camera with a pattern for each kind of image that is rendered."""
    name = camera.name
    return replace(
        camera,
        mask=f"{name}/mask/{{frame:06d}}.png",
        depth=f"{name}/depth/{{frame:06d}}.tiff" if images.depth else None,
        coverage=f"{name}/coverage/{{frame:06d}}.png" if images.coverage else None,
        normal=f"{name}/normal/{{frame:06d}}.png" if images.normals else None,
        flow=f"{name}/flow/{{frame:06d}}.tiff" if images.flow else None,
    )


def record_scene(plan: ScenePlan, folder: Path) -> tuple[Capture, Costs]:
    """Render and write a scene; `capture.json` comes last.

    Args:
        plan: the same plan gives the same bytes.
        folder: becomes the capture; `scene.usda` in it is the scene's stage.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _author(plan, folder / "scene.usda")
    meshes = tuple(load_animated_mesh(actor.stage) for actor in plan.actors)
    costs, views = Costs(), {}
    renderer = SceneRenderer(meshes, plan.environment, plan.images)
    for frame in range(plan.frames):
        views |= _record_frame(renderer, plan, frame, folder, costs)
    empty = Capture(folder, plan.fps, plan.frames, plan.calibration, None)
    objects = [_tracked(index, plan, meshes[index], views, empty) for index in range(len(plan.actors))]
    capture = replace(empty, truth=Truth(tuple(objects)))
    write_capture_json(capture)
    return capture, costs


def _author(plan: ScenePlan, path: Path) -> None:
    objects = [
        StagedObject(actor.stage, poses_of(_inside(actor.flight, plan), np.zeros(3)), actor.phase)
        for actor in plan.actors
    ]
    towards = [plan.environment.lighting(frame / plan.fps).sun_direction for frame in range(plan.frames)]
    sun = np.array(towards) / np.linalg.norm(towards, axis=1, keepdims=True)
    scenery = None
    if plan.landscape is not None:
        scenery = path.with_name("scenery.usdc")
        write_scenery(scenery, plan.landscape)
    sun = sun[:1] if np.all(sun == sun[0]) else sun
    author_stage(path, objects, plan.cameras, fps=plan.fps, sun=sun, scenery=scenery)


def _inside(flight: Flight, plan: ScenePlan) -> Flight:
    """The part of a flight that the capture's frames show."""
    part = slice(plan.margin, plan.margin + plan.frames)
    return Flight(flight.position[part], flight.world_from_body[part])


def poses_at(flight: Flight, index: float) -> Float[np.ndarray, "4 4"]:
    """`world_from_body` at an index that need not be whole: straight between positions, shortest between attitudes."""
    last = len(flight.position) - 1
    index = float(np.clip(index, 0.0, last))
    before = min(int(index), max(last - 1, 0))
    share, after = index - before, min(before + 1, last)
    pose = np.eye(4)
    pose[:3, 3] = (1 - share) * flight.position[before] + share * flight.position[after]
    pose[:3, :3] = flight.world_from_body[before]
    if share > 0:
        ends = Rotation.from_matrix(flight.world_from_body[[before, after]])
        pose[:3, :3] = Slerp([0.0, 1.0], ends)(share).as_matrix()
    return pose


def _record_frame(renderer: SceneRenderer, plan: ScenePlan, frame: int, folder: Path, costs: Costs) -> Views:
    views: Views = {}
    posed: float | None = None
    for index, camera in enumerate(plan.cameras):
        sensor = plan.sensors[index] if plan.sensors else SensorConfig()
        moment = frame + camera.time_offset_s * plan.fps
        clock = time.perf_counter()
        if posed != moment:
            _pose(renderer, plan, moment)
            posed = moment
        costs.simulate, clock = costs.simulate + time.perf_counter() - clock, time.perf_counter()
        image = renderer.image(camera, time=moment / plan.fps)
        rgb = None
        if sensor != SensorConfig():
            rng = np.random.default_rng([plan.noise_seed, index, frame])
            rgb = _sensed(renderer, plan, camera, moment, image, sensor, rng)
            posed = None  # the shutter's moments moved the objects
        costs.cast, clock = costs.cast + time.perf_counter() - clock, time.perf_counter()
        write_rendering(folder, camera, frame, image, rgb)
        costs.write, costs.images = costs.write + time.perf_counter() - clock, costs.images + 1
        views[camera.name, frame] = image.objects
    return views


def _sensed(
    renderer: SceneRenderer,
    plan: ScenePlan,
    camera: CaptureCamera,
    moment: float,
    image: Rendering,
    sensor: SensorConfig,
    rng: np.random.Generator,
) -> UInt8[np.ndarray, "height width 3"]:
    """The whole picture as the camera's sensor stores it."""

    def picture(seconds: float) -> np.ndarray:
        _pose(renderer, plan, moment + seconds * plan.fps)
        return renderer.image(camera, time=moment / plan.fps + seconds).full_rgb()

    still = sensor.shutter == 0 and sensor.row_time == 0
    rgb = image.full_rgb() if still else through_shutter(picture, camera.height, sensor, plan.fps)
    return np.round(np.clip(expose(rgb, sensor, rng=rng), 0.0, 1.0) * 255.0).astype(np.uint8)


def _pose(renderer: SceneRenderer, plan: ScenePlan, frame: float) -> None:
    def moment(at: float) -> tuple[list[float], np.ndarray]:
        seconds = [actor.phase + at / plan.fps for actor in plan.actors]
        return seconds, np.stack([poses_at(actor.flight, at + plan.margin) for actor in plan.actors])

    following = moment(frame + 1) if plan.images.flow else (None, None)
    renderer.pose(*moment(frame), next_seconds=following[0], next_world_from_body=following[1])


def write_rendering(
    folder: Path,
    camera: CaptureCamera,
    frame: int,
    image: Rendering,
    rgb: UInt8[np.ndarray, "height width 3"] | None = None,
) -> None:
    """Write the images of one rendering that the camera has patterns for; `rgb` replaces its colours."""
    constant = image.background.ndim == 1
    around = np.round(image.background * 255.0).astype(int).tolist() if constant else (0, 0, 0)
    if rgb is None:
        rgb = np.round(image.rgb * 255.0).astype(np.uint8) if constant else image.full_rgb8()
    coverage = None if image.coverage is None else np.round(image.coverage * 255.0).astype(np.uint8)
    extra = FrameExtras(
        coverage if camera.coverage else None,
        image.normal if camera.normal else None,
        image.flow if camera.flow else None,
    )
    depth = image.depth if camera.depth else None
    placement = Placement((image.window[0], image.window[1]), (around[0], around[1], around[2]))
    write_frame(folder, camera, frame, rgb, image.mask, depth, extra=extra, placement=placement)


def _tracked(index: int, plan: ScenePlan, mesh: AnimatedMesh, views: Views, capture: Capture) -> TrackedObject:
    actor = plan.actors[index]
    flight = _inside(actor.flight, plan)
    quaternions = _quaternions(flight.world_from_body)
    states = []
    for frame in range(plan.frames):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = flight.world_from_body[frame], flight.position[frame]
        joints = _joints(mesh.joints_at(actor.phase + frame / plan.fps), pose)
        x, y, z = flight.position[frame].tolist()
        state = ObjectState(frame, (x, y, z), quaternions[frame], {}, {}, joints=joints)
        states.append(_with_views(state, _seen(index, frame, views, capture)))
    identity = actor.identity
    return TrackedObject(index + 1, identity.label, identity.name, tuple(states), actor.source, actor.licence)


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
