"""Cameras are checked by the rays through an object."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support.broken_captures import make_camera
from support.export_examples import write_balls

from aerojax.core.types import Silhouette
from aerojax.geometry.cameras import invert_rigid, look_at, project_points
from aerojax.pipeline.rig_check import check_rays, check_rig
from aerojax.segment.given import GivenConfig

PLACES = np.array([[20.0, 0.0, 2.0], [-3.0, 22.0, 3.0], [-18.0, -6.0, 1.0], [5.0, -25.0, 2.5]])
PATH = np.array([[0.0, 0.0, 8.0], [1.0, 0.5, 8.2], [2.0, 0.7, 8.1]])


@pytest.fixture(scope="module")
def cameras():
    K = np.array([[800.0, 0.0, 320.0], [0.0, 800.0, 240.0], [0.0, 0.0, 1.0]])
    return [
        make_camera(0, name=f"c{i}", K=K, width=640, height=480, world_from_cam=look_at(place, PATH[0]))
        for i, place in enumerate(PLACES)
    ]


def silhouettes(cameras, half=12.0):
    """Boxes about where the cameras see an object that flies along PATH."""
    frames = []
    for point in PATH:
        centres = [project_points(point, camera) for camera in cameras]
        boxes = [(float(u) - half, float(v) - half, float(u) + half, float(v) + half) for u, v in centres]
        frames.append([Silhouette(i, 1, np.zeros((1, 1), np.float32), box, True) for i, box in enumerate(boxes)])
    return frames


def test_cameras_that_agree(cameras):
    found = check_rays(silhouettes(cameras), cameras)
    assert found.agrees and found.convention is None and (found.usable, found.met) == (3, 3)
    assert found.sentence() == "rays through the object meet in 3 of 3 frames, off by 0.0 px at most"
    np.testing.assert_allclose(found.positions, PATH, atol=1e-9)


def test_another_convention_is_named(cameras):
    turned = [dataclasses.replace(c, world_from_cam=invert_rigid(c.world_from_cam)) for c in cameras]
    found = check_rays(silhouettes(cameras), turned)
    assert found.agrees is False and found.convention is not None
    assert "world_from_cam holds cam_from_world" in found.sentence() and "write its inverse" in found.sentence()


def test_a_camera_that_was_moved_fits_no_convention(cameras):
    moved = cameras[1].world_from_cam.copy()
    moved[:3, 3] += 3.0
    off = [cameras[0], dataclasses.replace(cameras[1], world_from_cam=moved), *cameras[2:]]
    found = check_rays(silhouettes(cameras), off)
    assert found.agrees is False and found.convention is None and "check calibration" in found.sentence()
    assert max(found.offset_px, key=lambda name: found.offset_px[name]) == "c1"


def test_images_are_segmented(tmp_path):
    capture = write_balls(tmp_path / "capture")
    found = check_rig(capture, GivenConfig(), object_id=1)
    assert found.agrees and found.frames == 3
    states = [state.position for state in capture.truth.objects[0].frames]
    assert min(np.linalg.norm(np.array(states) - found.positions[0], axis=1)) < 0.02
    blind = (dataclasses.replace(capture.cameras[0], mask=None), *capture.cameras[1:])
    nothing = check_rig(dataclasses.replace(capture, cameras=blind), GivenConfig(), object_id=1)
    assert nothing.agrees is None and "not checked" in nothing.sentence()
