"""Small reports of classified captures, made of arithmetic."""

from __future__ import annotations

import dataclasses

import numpy as np

from aerojax.geometry.cameras import look_at
from aerojax.view.report.content import CameraCrop, ClassificationReport, FrameReport
from aerojax.view.viewer.content import Lens, SceneCamera, Splats

CLASSES = ("bird", "drone", "airplane", "helicopter")
CAMERAS = ("cam_01", "cam_02", "cam_03")


def make_splats(count: int, seed: int) -> Splats:
    """A ball of Gaussians of every colour, a metre across."""
    rng = np.random.default_rng(seed)
    draw = {
        "mean": rng.normal(size=(count, 3)) * 0.2,
        "quaternion": rng.normal(size=(count, 4)),
        "scale": rng.uniform(0.01, 0.08, (count, 3)),
        "opacity": rng.uniform(0.3, 1, count),
        "rgb": rng.uniform(size=(count, 3)),
    }
    return Splats(**{name: value.astype(np.float32) for name, value in draw.items()})


def make_camera(index: int, name: str) -> SceneCamera:
    """One of a ring of cameras, 10 m from the object's usual place."""
    place = np.array([10 * np.cos(index), 10 * np.sin(index), 2.0])
    return SceneCamera(name, Lens(900.0, 900.0, 480.0, 270.0, 960, 540), look_at(place, np.array([1.0, 2.0, 8.0])))


def make_frame(frame: int, cameras: tuple[str, ...] = CAMERAS, side: int = 40) -> FrameReport:
    """A red rectangle in every camera, and a ball of 500 Gaussians that flies along x."""
    centre = np.array([1.0 + frame, 2.0, 8.0])
    crops = []
    for index, camera in enumerate(cameras):
        rgb = np.full((side, side + 10, 3), 30 * index + 20, np.uint8)
        mask = np.zeros((side, side + 10), bool)
        mask[10:30, 5:25] = True
        rgb[mask] = (200, 40, 40)
        pose = make_camera(index, camera).world_from_cam.copy()
        pose[:3, 3] -= centre
        lens = Lens(300.0, 300.0, 25.0, 20.0, side + 10, side)
        crops.append(CameraCrop(camera, rgb, mask, (100.0, 50.0, 150.0, 90.0), (960, 540), lens, pose))
    probabilities = np.array([0.1, 0.7, 0.15, 0.05], np.float32)
    return FrameReport(frame, tuple(crops), make_splats(500, frame), centre, probabilities, centre)


def make_report(frames: tuple[FrameReport, ...], **changes) -> ClassificationReport:
    """A drone with three dropped frames."""
    report = ClassificationReport(
        title="flight 7",
        label="drone",
        probabilities=dict(zip(CLASSES, (0.0312, 0.9123, 0.0441, 0.0124), strict=True)),
        truth="drone",
        frames=frames,
        dropped={3: "too few cameras", 4: "too few cameras", 9: "too small"},
        latency_ms={"read": 12.34, "reconstruct": 201.5},
        rig=tuple(make_camera(index, name) for index, name in enumerate(CAMERAS)),
        notes=("A remark.",),
        made_by={"aerojax": "1.2.3", "weights": "views"},
    )
    return dataclasses.replace(report, **changes)
