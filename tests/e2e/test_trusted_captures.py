"""Captures of another renderer: believed as they are, and not with one camera turned, moved or late."""

from __future__ import annotations

from dataclasses import replace

import jax
import numpy as np
import pytest
from support.disagreeing_cameras import turned

from aerojax.capture.format import Capture, CaptureCamera, read_capture
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.offline import reconstruct_capture
from aerojax.pipeline.trust import TrustConfig, Verdict
from aerojax.reconstruct.hull import HullConfig

SMALL = PipelineConfig(reconstruct=HullConfig(grid=32, capacity=1024), decimation=DecimationConfig(1024, 96, 64))
FRAMES = 8
CAMERA = 2
"""That is wrong."""


@pytest.fixture(params=["drone_px4_iris", "heli_bo105", "plane_fg_cub"])
def capture(request, shared) -> Capture:
    folder = shared / "data/captures" / request.param
    if not folder.is_dir():
        pytest.skip(f"no capture at {folder}")
    return replace(read_capture(folder), frames=FRAMES)


def verdict_with(capture: Capture, cameras: tuple[CaptureCamera, ...]) -> Verdict:
    return reconstruct_capture(replace(capture, cameras=cameras), SMALL, key=jax.random.key(0)).verdict


def moved(cameras: tuple[CaptureCamera, ...], metres: float) -> tuple[CaptureCamera, ...]:
    """The camera stated to stand aside, along its own right axis."""
    pose = cameras[CAMERA].world_from_cam.copy()
    pose[:3, 3] += metres * pose[:3, 0]
    return tuple(replace(c, world_from_cam=pose) if n == CAMERA else c for n, c in enumerate(cameras))


def test_as_it_is_it_is_believed(capture):
    found = verdict_with(capture, capture.cameras)
    assert found.status == "ok" and found.disagreement < 0.8 * TrustConfig().most_disagreement


def test_one_degree_is_noticed_and_the_camera_named(capture):
    found = verdict_with(capture, turned(capture.cameras, CAMERA, (0.6, 0.8, 0.0)))
    assert found.status != "ok" and found.suspect is not None
    assert found.suspect.camera == CAMERA and found.suspect.cause != "clock"
    assert found.suspect.turn_deg == pytest.approx(1.0, rel=0.3)


def test_a_third_of_a_metre_is_noticed_and_the_camera_named(capture):
    found = verdict_with(capture, moved(capture.cameras, 0.3))
    assert found.status != "ok" and found.suspect is not None
    assert found.suspect.camera == CAMERA and found.suspect.offset_m == pytest.approx(0.3, rel=0.3)


def test_three_frames_are_noticed_and_the_clock_named(capture):
    late = replace(capture.cameras[CAMERA], time_offset_s=3 / capture.fps)  # of which the camera knows nothing
    cameras = tuple(late if n == CAMERA else c for n, c in enumerate(capture.cameras))
    clip = reconstruct_capture(replace(capture, cameras=cameras, frames=FRAMES + 3), SMALL, key=jax.random.key(0))
    assert capture.truth is not None
    places = np.array([state.position for state in capture.truth.objects[0].frames])[: FRAMES + 3]
    if (away := float(np.linalg.norm(places[3:] - places[:-3], axis=1).mean())) < 0.3:
        pytest.skip(f"the object moves by {away:.2f} m in three frames")
    found = clip.verdict
    assert found.status != "ok" and found.suspect is not None
    assert found.suspect.camera == CAMERA and found.suspect.cause != "turn"
    assert -4.0 < found.suspect.late_s * capture.fps < -1.0  # it shows what was before; a dart is no straight line
