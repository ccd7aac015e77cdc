"""The renderer against Blender Cycles in one run: the same triangles, texture, light, cameras and sub-pixel samples."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from aerojax.capture.format import CaptureCamera
from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from aerojax.simulate.assets.catalogue import Identity, build_identity, identities
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.render.image import ImageConfig, RenderedImage
from aerojax.simulate.render.scene import SceneRenderer
from aerojax.simulate.usd.animated_mesh import AnimatedMesh, load_animated_mesh
from aerojax.simulate.world.fixed_rigs import FixedRigConfig, conditions, place_cameras
from experiments._benchmarks.simulator import dataset_config
from kernels.rays.raytrace import Lighting

MISSING = "not measured: install .[bench], or name a Python that has bpy in BLENDER_PYTHON"
SAMPLES = 16
LIGHT = Lighting(shadows=True)
REPEATS = 5
RADII = (4, 16, 64)
SECONDS_BETWEEN_POSES = 0.1
_WORKER = Path(__file__).with_name("_blender_worker.py")
_ANSWER = "cycles-answer "


@dataclass(frozen=True)
class Case:
    """One object before the four cameras of Sim-1 at one radius (metres)."""

    identity: Identity
    radius: float


def blender_python() -> str | None:
    """A Python that can `import bpy`: this one, or the one that BLENDER_PYTHON names."""
    if importlib.util.find_spec("bpy") is not None:
        return sys.executable
    return os.environ.get("BLENDER_PYTHON")


class Cycles:
    """Blender in a process of its own, with one object in it.

    Raises:
        RuntimeError: it ended instead of answering; its last words are in the message.
    """

    def __init__(self, process: subprocess.Popen[str]):
        self._process = process
        self.version = str(self._answer()["blender"])

    def render(
        self, pose: int, views: list[dict[str, Any]], *, samples: int = SAMPLES, keep: bool = False
    ) -> dict[str, float]:
        """Pose the object and render every view; wall-clock and processor seconds. `keep` leaves pictures behind."""
        request = {"pose": pose, "views": views, "samples": samples, "keep": keep}
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        last: list[str] = []
        for line in self._process.stdout:
            if line.startswith(_ANSWER):
                return json.loads(line.removeprefix(_ANSWER))
            last = [*last[-19:], line]
        raise RuntimeError("Blender ended: " + "".join(last))


@contextmanager
def open_cycles(python: str, folder: Path, threads: int) -> Iterator[Cycles]:
    """Blender with the scene that `export_scene` wrote to the folder.

    A process has one number of threads, since a change would throw away what Cycles keeps between pictures.
    """
    command = [python, str(_WORKER), str(folder), str(threads)]
    pipes: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with subprocess.Popen(command, text=True, **pipes) as process:
        try:
            yield Cycles(process)
        finally:
            process.kill()


def export_scene(mesh: AnimatedMesh, folder: Path) -> None:
    """Triangles of every pose, looks and light, as the worker reads them."""
    picture = mesh.textures[0] if mesh.textures else np.full((1, 1, 3), 255, np.uint8)
    if len(mesh.textures) > 1 or len(np.unique(mesh.texture)) > 1:
        raise ValueError("the comparison takes objects with one texture on all faces, or none")
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / "texture.png"), np.ascontiguousarray(picture[..., ::-1]))
    poses = np.stack([mesh.vertices_at(SECONDS_BETWEEN_POSES * k) for k in range(REPEATS + 1)])
    arrays = {"vertices": poses, "faces": mesh.faces, "uv": mesh.uv, "albedo": linear_from_srgb(mesh.albedo)}
    np.savez(folder / "scene.npz", **arrays)
    to_sun = (np.array(LIGHT.sun_direction) / np.linalg.norm(LIGHT.sun_direction)).tolist()
    light = {"to_sun": to_sun, "sun": LIGHT.sun, "sky": LIGHT.sky, "ground": LIGHT.ground}
    (folder / "light.json").write_text(json.dumps(light))


def view_of(camera: CaptureCamera, image: RenderedImage) -> dict[str, Any]:
    """A camera and the region of its image that the object fills."""
    return {
        "width": camera.width,
        "height": camera.height,
        "K": camera.K.tolist(),
        "world_from_cam": camera.world_from_cam.tolist(),
        "window": image.window,
    }


def ours(
    renderer: SceneRenderer, cameras: tuple[CaptureCamera, ...], pose: int
) -> tuple[list[RenderedImage], float, float]:
    """Pose the object and render every camera: images, wall-clock and processor seconds."""
    wall, cpu = time.perf_counter(), time.process_time()
    renderer.pose([SECONDS_BETWEEN_POSES * pose], np.eye(4)[None])
    images = [renderer.image(camera) for camera in cameras]
    return images, time.perf_counter() - wall, time.process_time() - cpu


def agreement(image: RenderedImage, cycles: np.ndarray, threshold: float) -> dict[str, float]:
    """Of one window: IoU of the masks, mean difference of coverage at silhouettes, and of colour where both are whole.

    Args:
        image: ours, with coverage.
        cycles: linear colour times coverage, and coverage (row, column, 4).
        threshold: least coverage of a mask pixel.
    """
    assert image.coverage is not None
    one, two = image.coverage >= threshold, cycles[..., 3] >= threshold
    border = ((image.coverage > 0) | (cycles[..., 3] > 0)) & ((image.coverage < 1) | (cycles[..., 3] < 1))
    both = (image.coverage >= 1) & (cycles[..., 3] >= 1)
    colour = srgb_from_linear(cycles[both, :3])
    away = np.abs(image.rgb[both] - colour)
    return {
        "mask_iou": float((one & two).sum() / max((one | two).sum(), 1)),
        "coverage_difference_at_silhouettes": float(np.abs(image.coverage - cycles[..., 3])[border].mean()),
        "srgb_difference_mean": float(away.mean()) if both.any() else 0.0,
        "srgb_difference_median": float(np.median(away)) if both.any() else 0.0,
        "srgb_bias": float((image.rgb[both] - colour).mean()) if both.any() else 0.0,
        "srgb_correlation": float(np.corrcoef(image.rgb[both].ravel(), colour.ravel())[0, 1]) if both.any() else 1.0,
    }


def compare(
    case: Case, fixed_rig: FixedRigConfig, one: Cycles, two: Cycles, mesh: AnimatedMesh, folder: Path
) -> dict[str, Any]:
    """Interleaved repetitions of one case, each with a new pose; medians of the time of one image.

    Args:
        case: what and from how far.
        fixed_rig: Sim-1's.
        one, two: Blender on one and on two threads.
        mesh: of the identity.
        folder: where Blender's scene is and pictures go.
    """
    condition = next(c for c in conditions(fixed_rig) if c.radius == case.radius)
    cameras = place_cameras(fixed_rig, condition)
    config = ImageConfig(samples=round(SAMPLES**0.5), rays_across=0)
    renderer = SceneRenderer((mesh,), Dome(LIGHT), config)
    images, _, _ = ours(renderer, cameras, 0)
    views = [view_of(camera, image) for camera, image in zip(cameras, images, strict=True)]
    two.render(0, views)
    one.render(0, views, keep=True)
    found = [
        agreement(image, np.load(folder / f"cycles_{k}.npy"), config.mask_threshold) for k, image in enumerate(images)
    ]
    times: dict[str, list[float]] = {}
    for pose in range(1, REPEATS + 1):
        images, wall, cpu = ours(renderer, cameras, pose)
        views = [view_of(camera, image) for camera, image in zip(cameras, images, strict=True)]
        rows = {"aerojax": {"wall": wall, "cpu": cpu}}
        rows["cycles"] = one.render(pose, views)
        rows["cycles_2_threads"] = two.render(pose, views)
        rows["cycles_4"] = one.render(pose, views, samples=4)
        for name, row in rows.items():
            for clock, value in row.items():
                times.setdefault(f"{name}_{clock}_s", []).append(value / len(cameras))
    return {
        "identity": case.identity.name,
        "triangles": len(mesh.faces),
        "radius_m": case.radius,
        "object_pixels": float(np.mean([np.count_nonzero(image.mask) for image in images])),
        **{name: round(float(np.median(values)), 5) for name, values in times.items()},
        "times_faster": _ratio(times, "cycles", "wall"),
        "times_faster_by_processor_time": _ratio(times, "cycles", "cpu"),
        "times_faster_than_cycles_on_2_threads": _ratio(times, "cycles_2_threads", "wall"),
        "times_faster_than_cycles_of_4_samples": _ratio(times, "cycles_4", "wall"),
        "agreement": {name: round(float(np.mean([f[name] for f in found])), 4) for name in found[0]},
    }


def _ratio(times: dict[str, list[float]], other: str, clock: str) -> float:
    """Median over repetitions of a ratio of neighbours in time, so that a machine's slow moments weigh on both."""
    pairs = zip(times[f"{other}_{clock}_s"], times[f"aerojax_{clock}_s"], strict=True)
    return round(float(np.median([theirs / own for theirs, own in pairs])), 2)


def measure() -> dict[str, Any] | str:
    """One test identity a class at several radii of Sim-1; a sentence where there is no Blender."""
    python, fixed_rig = blender_python(), dataset_config("sim1", "full").rig.fixed
    if python is None or fixed_rig is None:
        return MISSING
    rows, version = [], ""
    with tempfile.TemporaryDirectory() as name:
        for identity in identities("test")[:4]:
            folder = Path(name) / identity.name
            mesh = load_animated_mesh(build_identity(identity, Path(name)))
            export_scene(mesh, folder)
            with open_cycles(python, folder, 1) as one, open_cycles(python, folder, 2) as two:
                version = one.version
                rows += [compare(Case(identity, radius), fixed_rig, one, two, mesh, folder) for radius in RADII]
    keys = [key for key in rows[0] if key.startswith("times_faster")]
    return {
        "blender": version,
        "samples_a_pixel": SAMPLES,
        "note": "aerojax casts 16 rays where a silhouette crosses the pixel and 4 elsewhere, and gives depth, mask "
        "and coverage besides; Cycles gives colour and coverage, direct light only, border render and crop, persistent "
        "data, no denoiser. One thread each unless said; one frame = one new pose and four images.",
        "rows": rows,
        "median": {key: round(float(np.median([row[key] for row in rows])), 2) for key in keys},
        "least": {key: min(row[key] for row in rows) for key in keys},
    }
