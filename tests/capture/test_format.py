"""Captures on disk: round trips, overwriting, turned worlds and the reference captures."""

from __future__ import annotations

import dataclasses

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.broken_captures import make_good

from aerojax.capture.format import read_capture, rotate_world, write_capture_json
from aerojax.capture.frames import read_mask, read_rgb
from aerojax.core.errors import UserError
from aerojax.geometry.cameras import project_points

TURN = Rotation.from_euler("zyx", [1.1, -0.4, 2.3])


def test_round_trip(tmp_path):
    made = make_good(tmp_path)
    read = read_capture(tmp_path)
    assert (read.folder, read.fps, read.frames, read.truth) == (tmp_path, made.fps, made.frames, made.truth)
    for before, after in zip(made.cameras, read.cameras, strict=True):
        for field in dataclasses.fields(before):
            np.testing.assert_array_equal(getattr(before, field.name), getattr(after, field.name))
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_file()) == ["capture.json", "truth.json"]


def test_optional_parts_may_be_absent(tmp_path):
    made = make_good(tmp_path)
    bare = [dataclasses.replace(camera, mask=None, depth=None, time_offset_s=0.01) for camera in made.cameras]
    write_capture_json(dataclasses.replace(made, cameras=tuple(bare), truth=None), overwrite=True)
    read = read_capture(tmp_path)
    assert read.truth is None
    assert [(c.mask, c.depth, c.time_offset_s) for c in read.cameras] == [(None, None, 0.01)] * 3


def test_existing_capture_is_kept(tmp_path):
    made = make_good(tmp_path)
    before = (tmp_path / "capture.json").read_bytes()
    with pytest.raises(UserError, match="there is a capture already"):
        write_capture_json(dataclasses.replace(made, fps=5.0))
    assert (tmp_path / "capture.json").read_bytes() == before
    write_capture_json(dataclasses.replace(made, fps=5.0), overwrite=True)
    assert read_capture(tmp_path).fps == 5.0


def test_numbers_that_are_none_are_not_written(tmp_path):
    made = make_good(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.glob("*.json")}
    with pytest.raises(UserError, match="NaN or infinite"):
        write_capture_json(dataclasses.replace(made, fps=float("nan"), truth=None), overwrite=True)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


def test_rotate_world_keeps_every_pixel(tmp_path, x64):
    capture = make_good(tmp_path)
    turned = rotate_world(capture, TURN.as_matrix())
    for before, after in zip(capture.cameras, turned.cameras, strict=True):
        for old, new in zip(capture.truth.objects[0].frames, turned.truth.objects[0].frames, strict=True):
            expected = _pixel(before, np.array(old.position))
            np.testing.assert_allclose(_pixel(after, np.array(new.position)), expected, atol=1e-9)


def _pixel(camera, point):
    in_camera = camera.world_from_cam[:3, :3].T @ (point - camera.world_from_cam[:3, 3])
    return (camera.K @ in_camera)[:2] / in_camera[2]


def test_rotate_world_turns_orientations_in_double_precision(tmp_path):
    turned = rotate_world(make_good(tmp_path), TURN.as_matrix())
    w, x, y, z = turned.truth.objects[0].frames[0].orientation_wxyz
    matrix = Rotation.from_quat([x, y, z, w]).as_matrix()
    np.testing.assert_allclose(matrix, TURN.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(turned.truth.objects[0].frames[1].position, 0.1 * TURN.as_matrix()[:, 0], atol=1e-15)


def test_turned_capture_is_written_and_read(tmp_path):
    capture = make_good(tmp_path)
    write_capture_json(rotate_world(capture, TURN.as_matrix()), overwrite=True)
    np.testing.assert_allclose(
        read_capture(tmp_path).cameras[1].world_from_cam[:3, 3],
        TURN.as_matrix() @ capture.cameras[1].world_from_cam[:3, 3],
        atol=1e-14,
    )


@pytest.mark.parametrize("matrix", [np.diag([1.0, 1.0, -1.0]), 1.01 * np.eye(3)])
def test_rotate_world_refuses_other_matrices(tmp_path, matrix):
    with pytest.raises(UserError, match="orthonormal with determinant 1"):
        rotate_world(make_good(tmp_path), matrix)


def test_pinhole_is_single_precision(tmp_path):
    camera = make_good(tmp_path).cameras[0]
    pinhole = camera.pinhole()
    assert (pinhole.width, pinhole.height, pinhole.K.dtype) == (32, 24, jnp.float32)
    np.testing.assert_allclose(pinhole.world_from_cam, camera.world_from_cam, atol=1e-6)


@pytest.mark.parametrize(
    "name",
    [
        "bird_animalia_cardinal",
        "bird_avian_flybird",
        "drone_crazyflie",
        "drone_px4_iris",
        "heli_bo105",
        "heli_r44",
        "plane_fg_cub",
        "plane_rc_cessna",
    ],
)
def test_shared_truth_projects_into_its_boxes(shared, name):
    folder = shared / "data/captures" / name
    if not folder.is_dir():
        pytest.skip(f"no capture at {folder}")
    capture = read_capture(folder)
    (flown,) = capture.truth.objects
    assert len(flown.frames) == capture.frames
    positions = jnp.array([state.position for state in flown.frames], jnp.float32)
    project = jax.jit(project_points)
    for camera in capture.cameras:
        pixels = np.asarray(project(positions, camera.pinhole()))
        for state, (u, v) in zip(flown.frames, pixels, strict=True):
            x0, y0, x1, y1 = state.bbox[camera.name]
            assert x0 <= u <= x1 and y0 <= v <= y1, (camera.name, state.frame)


def test_shared_masks_fill_their_boxes(shared):
    capture = read_capture(shared / "data/captures/drone_crazyflie")
    for index, camera in enumerate(capture.cameras):
        mask, rgb = read_mask(capture, index, 3), read_rgb(capture, index, 3)
        assert set(np.unique(mask)) == {0, capture.truth.objects[0].object_id}
        x, y, width, height = cv2.boundingRect((mask > 0).astype(np.uint8))
        assert (x, y, x + width, y + height) == capture.truth.objects[0].frames[3].bbox[camera.name]
        assert rgb.shape == (540, 960, 3) and 0 <= rgb.min() < rgb.max() <= 1
