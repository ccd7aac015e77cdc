"""The data set generator: images a second by rig and preset, where time goes, and what cost grows with."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import aerojax.capture.write as writing
from aerojax.capture.format import CaptureCamera
from aerojax.core.config import to_dataclass
from aerojax.core.workers import run_jobs
from aerojax.simulate import record
from aerojax.simulate.assets.catalogue import Identity, build_identity, identities
from aerojax.simulate.plan import planner
from aerojax.simulate.plan.dataset import DatasetConfig, SequenceTask, work_list
from aerojax.simulate.plan.scene import image_patterns
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.render.outdoors import Outdoors
from aerojax.simulate.render.scene import SceneRenderer
from aerojax.simulate.usd.animated_mesh import load_animated_mesh
from aerojax.simulate.world.fixed_rigs import Condition, FixedRigConfig, conditions, place_cameras
from experiments._launch.composition import composed
from kernels.rays.raytrace import Lighting, SceneCaster

RIGS = ("sim1", "sim2", "sim3")
PRESETS = ("small", "full")
"""Those with images of 2560×1440."""
MOST_FRAMES = 16
"""Frames of a sequence that are measured: outdoors the sun moves the light twice in them. The landscape of a longer
sequence is shared by more images, so its rate is higher."""
REPEATS = 3

STEPS: tuple[tuple[str, Any, str], ...] = (
    ("plan", planner, "plan_sequence"),
    ("pose", SceneRenderer, "pose"),
    ("cast", SceneCaster, "footprint"),
    ("cast", SceneCaster, "cast"),
    ("landscape", Outdoors, "background"),
    ("shade", SceneRenderer, "image"),
    ("encode", writing, "encode_png"),
    ("encode", writing, "encode_tiff"),
    ("write", record, "write_image"),
)
"""Which functions count as which step. One inside another counts for itself alone; `cast` also evaluates the light of
what its rays meet, `shade` puts the pixels together, `plan` includes the landscape's mesh."""


@dataclass
class Stopwatch:
    """Seconds of a clock by step, without those of the steps inside."""

    clock: Callable[[], float] = time.process_time
    seconds: dict[str, float] = field(default_factory=dict)
    inner: list[float] = field(default_factory=list)

    def timed(self, step: str, function: Any) -> Any:
        """The function, which adds its own time to a step."""

        def run(*arguments: Any, **options: Any) -> Any:
            begin = self.clock()
            self.inner.append(0.0)
            try:
                return function(*arguments, **options)
            finally:
                spent = self.clock() - begin
                self.seconds[step] = self.seconds.get(step, 0.0) + spent - self.inner.pop()
                if self.inner:
                    self.inner[-1] += spent

        return run


@contextmanager
def stopwatch() -> Iterator[Stopwatch]:
    """Every function of `STEPS` is timed inside."""
    watch = Stopwatch()
    with ExitStack() as stack:
        for step, owner, name in STEPS:
            stack.enter_context(patch.object(owner, name, watch.timed(step, getattr(owner, name))))
        yield watch


def dataset_config(rig: str, preset: str, *overrides: str) -> DatasetConfig:
    """The configuration of `python -m experiments.generate_dataset rig=… preset=…`."""
    values = composed("generate_dataset", DatasetConfig, f"rig={rig}", f"preset={preset}", *overrides)
    decisive = {key: value for key, value in values.items() if key in DatasetConfig.__dataclass_fields__}
    return to_dataclass(decisive, DatasetConfig, source="conf/generate_dataset.yaml")


@dataclass(frozen=True)
class _Job:
    tasks: tuple[SequenceTask, ...]
    config: DatasetConfig
    folder: Path


@dataclass(frozen=True)
class _Spent:
    """Of some sequences, after one that warms the process up: images, wall-clock and processor seconds, and steps."""

    images: int
    wall: float
    cpu: float
    steps: dict[str, float]


def choose(config: DatasetConfig, count: int) -> tuple[SequenceTask, ...]:
    """Sequences spread over the classes and conditions of a work list."""
    tasks = work_list(config)
    by_condition = sorted({task.condition for task in tasks})
    wanted = [by_condition[round(k)] for k in np.linspace(0, len(by_condition) - 1, count)]
    labels = list(dict.fromkeys(task.identity.label for task in tasks))
    return tuple(
        next(t for t in tasks if t.condition == c and t.identity.label == labels[k % len(labels)])
        for k, c in enumerate(wanted)
    )


def _record(job: _Job) -> _Spent:
    first = replace(job.config, frames=1)
    record.record_scene(planner.plan_sequence(job.tasks[0], first, job.folder / "assets"), job.folder / "warm")
    for task in job.tasks:
        build_identity(task.identity, job.folder / "assets")
    images = 0
    with stopwatch() as watch:
        wall, cpu = time.perf_counter(), time.process_time()
        for number, task in enumerate(job.tasks):
            plan = planner.plan_sequence(task, job.config, job.folder / "assets")
            _, costs = record.record_scene(plan, job.folder / f"{number}")
            images += costs.images
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return _Spent(images, wall, cpu, {**watch.seconds, "other": cpu - sum(watch.seconds.values())})


def throughput(rig: str, preset: str, sequences: int) -> dict[str, Any]:
    """Images a second of whole sequences (planned, rendered, written), one process, and its time by step."""
    whole = dataset_config(rig, preset)
    config = replace(whole, frames=min(whole.frames, MOST_FRAMES))
    with tempfile.TemporaryDirectory() as folder:
        spent = _record(_Job(choose(config, sequences), config, Path(folder)))
    return {
        "rig": rig,
        "preset": preset,
        "sequences": sequences,
        "frames": config.frames,
        "frames_of_the_preset": whole.frames,
        "images": spent.images,
        "images_per_s": round(spent.images / spent.wall, 2),
        "images_per_cpu_s": round(spent.images / spent.cpu, 2),
        "cpu_ms_an_image": {step: round(1e3 * s / spent.images, 2) for step, s in sorted(spent.steps.items())},
    }


def two_workers(rig: str, preset: str, sequences: int) -> dict[str, Any]:
    """Images a second of two processes at the same time beside one alone, each after its first sequence."""
    config = dataset_config(rig, preset)
    config = replace(config, frames=min(config.frames, MOST_FRAMES))
    tasks = choose(config, sequences)
    with tempfile.TemporaryDirectory() as folder:
        alone = _record(_Job(tasks, config, Path(folder) / "alone"))
        jobs = [_Job(tasks, config, Path(folder) / str(worker)) for worker in range(2)]
        both = list(run_jobs(_record, jobs, workers=2))
    together = sum(s.images / s.wall for s in both)
    return {
        "rig": rig,
        "preset": preset,
        "one_images_per_s": round(alone.images / alone.wall, 2),
        "two_images_per_s": round(together, 2),
        "speed_up": round(together * alone.wall / alone.images, 2),
        "one_images_per_cpu_s": round(alone.images / alone.cpu, 2),
        "two_images_per_cpu_s": round(sum(s.images for s in both) / sum(s.cpu for s in both), 2),
    }


def image_cost(identity: Identity, camera: CaptureCamera, folder: Path) -> dict[str, float]:
    """Pixels of the object and of the image, and processor seconds to pose, render and write one on the white dome."""
    mesh = load_animated_mesh(build_identity(identity, folder / "assets"))
    images = ImageConfig()
    renderer = SceneRenderer((mesh,), Dome(Lighting()), images)
    camera = image_patterns(camera, images)
    times = []
    for repeat in range(REPEATS + 1):
        begin = time.process_time()
        renderer.pose([0.1 * repeat], np.eye(4)[None])
        image = renderer.image(camera)
        rendered = time.process_time()
        record.write_image(folder, camera, repeat, image)
        times.append((rendered - begin, time.process_time() - rendered))
    render, write = np.median(times[1:], axis=0).tolist()
    return {
        "object_pixels": float(np.count_nonzero(image.mask)),
        "image_pixels": float(camera.width * camera.height),
        "render_cpu_s": render,
        "write_cpu_s": write,
        "cpu_s": render + write,
    }


def slope(rows: list[dict[str, float]], against: str, of: str = "cpu_s") -> float:
    """Of the straight line through the logarithms: 1 = proportional, 0 = independent."""
    x, y = np.log([[row[against], row[of]] for row in rows]).T
    return round(float(np.polyfit(x, y, 1)[0]), 3)


def growth(fixed_rig: FixedRigConfig, identity: Identity) -> dict[str, Any]:
    """Cost against object pixels at one image size, and against image pixels at one object size."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def cost(radius: float, scale: float) -> dict[str, float]:
            sized = replace(fixed_rig, width=round(fixed_rig.width * scale), height=round(fixed_rig.height * scale))
            camera = place_cameras(sized, Condition("", radius, 20.0))[0]
            return image_cost(identity, camera, folder)

        objects = [cost(radius, 1.0) for radius in (280, 140, 70, 35, 16, 8, 4, 2)]
        images = [cost(32.0, scale) for scale in (0.125, 0.25, 0.5, 1.0, 2.0)]
    large = [row for row in objects if row["object_pixels"] > 5_000]
    return {
        "identity": identity.name,
        "against_object_pixels": {
            "slope": slope(objects, "object_pixels"),
            "slope_above_5000_pixels": slope(large, "object_pixels"),
            "rows": objects,
        },
        "against_image_pixels": {
            "slope": slope(images, "image_pixels"),
            "slope_of_rendering": slope(images, "image_pixels", "render_cpu_s"),
            "slope_of_writing": slope(images, "image_pixels", "write_cpu_s"),
            "rows": images,
        },
    }


def measure() -> dict[str, Any]:
    """All figures, in about ten minutes on two quiet cores; processor time tells more where other programs run."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    fixed_rig = dataset_config("sim1", "full").rig.fixed
    assert fixed_rig is not None and conditions(fixed_rig)
    load = os.getloadavg()[0]
    return {
        "cores": cores,
        "load_average": load,
        "throughput": [throughput(rig, preset, 2 if rig == "sim1" else 1) for rig in RIGS for preset in PRESETS],
        "two_workers": [two_workers(rig, "small", 1) for rig in RIGS],
        "growth": growth(fixed_rig, identities("test")[0]),
        "load_average_at_the_end": os.getloadavg()[0],
    }
