"""A planned scene to disk: every camera's images of every frame, the stage, and what really flew."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from aerojax.capture.format import Capture, CaptureCamera, Truth, write_capture_json
from aerojax.capture.paths import frame_path
from aerojax.capture.write import FrameExtras, Placement, write_frame
from aerojax.gaussians.io.ply import write_ply
from aerojax.simulate.plan.scene import ScenePlan
from aerojax.simulate.render.image import RenderedImage
from aerojax.simulate.render.scene import SceneRenderer
from aerojax.simulate.surface import draw_surface_points, surface_gaussians
from aerojax.simulate.truth import Views, tracked_object
from aerojax.simulate.usd.animated_mesh import AnimatedMesh, load_animated_mesh
from aerojax.simulate.usd.scene_stage import StageObject, write_landscape_stage, write_scene_stage
from aerojax.simulate.world.sensor import SensorConfig, expose, through_shutter


@dataclass
class Timings:
    """Seconds spent on posing, casting and writing, and images written."""

    simulate: float = 0.0
    cast: float = 0.0
    write: float = 0.0
    images: int = 0


def record_scene(plan: ScenePlan, folder: Path) -> tuple[Capture, Timings]:
    """Render and write a scene; `capture.json` comes last.

    Args:
        plan: the same plan gives the same bytes.
        folder: becomes the capture; `scene.usda` in it is the scene's stage.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _write_stage(plan, folder / "scene.usda")
    meshes = tuple(load_animated_mesh(flown.asset) for flown in plan.objects)
    timings, views = Timings(), {}
    renderer = SceneRenderer(meshes, plan.environment, plan.images)
    for frame in range(plan.frames):
        views |= _record_frame(renderer, plan, frame, folder, timings)
    empty = Capture(folder, plan.fps, plan.frames, plan.calibration, None)
    objects = [
        replace(tracked_object(index, plan, mesh, views, empty), gaussians=_write_surface(index, plan, mesh, folder))
        for index, mesh in enumerate(meshes)
    ]
    capture = replace(empty, truth=Truth(tuple(objects)))
    write_capture_json(capture)
    return capture, timings


def _write_stage(plan: ScenePlan, path: Path) -> None:
    objects = [StageObject(o.asset, plan.shown(o.flight).transforms(), o.phase) for o in plan.objects]
    towards = [plan.environment.lighting(frame / plan.fps).sun_direction for frame in range(plan.frames)]
    sun = np.array(towards) / np.linalg.norm(towards, axis=1, keepdims=True)
    landscape = None
    if plan.landscape is not None:
        landscape = path.with_name("scenery.usdc")
        write_landscape_stage(landscape, plan.landscape)
    sun = sun[:1] if np.all(sun == sun[0]) else sun
    write_scene_stage(path, objects, plan.cameras, fps=plan.fps, sun=sun, landscape=landscape)


def _record_frame(renderer: SceneRenderer, plan: ScenePlan, frame: int, folder: Path, timings: Timings) -> Views:
    views: Views = {}
    posed: float | None = None
    for index, camera in enumerate(plan.cameras):
        sensor = plan.sensors[index] if plan.sensors else SensorConfig()
        moment = frame + camera.time_offset_s * plan.fps
        clock = time.perf_counter()
        if posed != moment:
            _pose(renderer, plan, moment)
            posed = moment
        timings.simulate, clock = timings.simulate + time.perf_counter() - clock, time.perf_counter()
        image = renderer.image(camera, time=moment / plan.fps)
        rgb = None
        if sensor != SensorConfig():
            rng = np.random.default_rng([plan.noise_seed, index, frame])
            rgb = _sensed(renderer, plan, camera, moment, image, sensor, rng)
            posed = None  # the shutter's moments moved the objects
        timings.cast, clock = timings.cast + time.perf_counter() - clock, time.perf_counter()
        write_image(folder, camera, frame, image, rgb)
        timings.write, timings.images = timings.write + time.perf_counter() - clock, timings.images + 1
        views[camera.name, frame] = image.objects
    return views


def _sensed(
    renderer: SceneRenderer,
    plan: ScenePlan,
    camera: CaptureCamera,
    moment: float,
    image: RenderedImage,
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


def _write_surface(index: int, plan: ScenePlan, mesh: AnimatedMesh, folder: Path) -> str | None:
    """Write the Gaussians of one object's surface, a file a frame; their pattern, or None where none are wanted."""
    if not plan.surface.count:
        return None
    pattern = f"gaussians/object_{index + 1}/{{frame:06d}}.ply"
    flown, thickness = plan.objects[index], plan.surface.thickness
    points = draw_surface_points(mesh, plan.surface.count, plan.surface.seed)
    for frame, pose in enumerate(plan.shown(flown.flight).transforms()):
        vertices = mesh.vertices_at(flown.phase + frame / plan.fps).astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        found = surface_gaussians(vertices, mesh.faces, points, thickness=thickness)
        write_ply(folder / frame_path(pattern, frame), found.gaussians(), normal=found.normal)
    return pattern


def _pose(renderer: SceneRenderer, plan: ScenePlan, frame: float) -> None:
    def moment(at: float) -> tuple[list[float], np.ndarray]:
        seconds = [flown.phase + at / plan.fps for flown in plan.objects]
        return seconds, np.stack([flown.flight.transform_at(at + plan.margin) for flown in plan.objects])

    following = moment(frame + 1) if plan.images.flow else (None, None)
    renderer.pose(*moment(frame), next_seconds=following[0], next_world_from_body=following[1])


def write_image(
    folder: Path,
    camera: CaptureCamera,
    frame: int,
    image: RenderedImage,
    rgb: UInt8[np.ndarray, "height width 3"] | None = None,
) -> None:
    """Write the kinds of a rendered image that the camera has patterns for; `rgb` replaces its colours."""
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
