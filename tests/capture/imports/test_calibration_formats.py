"""Calibrations of other tools: what they write comes back as the cameras that they were made of."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
import yaml
from support import calibration_files
from support.export_examples import write_balls

from aerojax.capture.imports.calibration.auto import recognise
from aerojax.capture.imports.calibration.colmap import ColmapConfig
from aerojax.capture.imports.calibration.drone_tracking import DroneTrackingConfig
from aerojax.capture.imports.calibration.kalibr import KalibrConfig
from aerojax.capture.imports.calibration.nerfstudio import NerfstudioConfig
from aerojax.capture.imports.calibration.opencv import OpencvConfig
from aerojax.capture.imports.calibration.projections import ProjectionsConfig
from aerojax.capture.imports.calibration.ros import RosConfig
from aerojax.core.errors import UserError
from aerojax.data.exports.export import export_dataset
from aerojax.data.exports.sources import ExportOptions, find_sequences

LENS = (-0.08, 0.02, 0.001, -0.0015)


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    return write_balls(tmp_path_factory.mktemp("balls") / "capture")


@pytest.fixture(scope="module")
def lensed(capture):
    """The same cameras with lenses."""
    return [dataclasses.replace(c, distortion_model="opencv", distortion=LENS) for c in capture.cameras]


def export(capture, tmp_path, name):
    folder = export_dataset(find_sequences(capture.folder), name, tmp_path, ExportOptions(images="hardlink"))
    return folder / "all" / capture.folder.name


def assert_same(found, cameras, *, atol=1e-9, moved=None):
    """Names, lenses and poses."""
    by_name = {camera.name: camera for camera in found.cameras}
    for camera in cameras:
        one = by_name[camera.name]
        np.testing.assert_allclose(one.K, camera.K, atol=max(atol, 1e-9), rtol=1e-9)
        pose = one.world_from_cam if moved is None else moved @ one.world_from_cam
        np.testing.assert_allclose(pose, camera.world_from_cam, atol=atol)
        assert (one.width, one.height) in ((camera.width, camera.height), (None, None))
        assert one.distortion_model == camera.distortion_model
        np.testing.assert_allclose(one.distortion[:4], camera.distortion[:4], atol=1e-12)
    assert len(by_name) == len(cameras)


def test_colmap_text_is_our_export(capture, tmp_path):
    model = export(capture, tmp_path, "colmap") / "sparse/0"
    assert isinstance(recognise(model), ColmapConfig)
    assert_same(ColmapConfig().read(model), capture.cameras)


def test_colmap_binary_is_that_of_pycolmap(capture, tmp_path):
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is missing; see requirements.clients.lock")
    model = pycolmap.Reconstruction(str(export(capture, tmp_path, "colmap") / "sparse/0"))
    (tmp_path / "binary").mkdir()
    model.write_binary(str(tmp_path / "binary"))
    found = ColmapConfig().read(tmp_path / "binary")
    assert_same(found, capture.cameras)
    assert found.cameras[0].files == tuple(f"{found.cameras[0].name}/{i:06d}.png" for i in range(capture.frames))


@pytest.mark.parametrize(
    ("model", "parameters", "expected"),
    [
        ("SIMPLE_PINHOLE", "50 30 20", ("none", ())),
        ("SIMPLE_RADIAL", "50 30 20 0.1", ("opencv", (0.1, 0.0, 0.0, 0.0))),
        ("RADIAL", "50 30 20 0.1 0.2", ("opencv", (0.1, 0.2, 0.0, 0.0))),
        ("OPENCV", "50 51 30 20 0.1 0.2 0.3 0.4", ("opencv", (0.1, 0.2, 0.3, 0.4))),
        ("FULL_OPENCV", "50 51 30 20 .1 .2 .3 .4 .5 .6 .7 .8", ("opencv", (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8))),
        ("OPENCV_FISHEYE", "50 51 30 20 0.1 0.2 0.3 0.4", ("opencv_fisheye", (0.1, 0.2, 0.3, 0.4))),
        ("RADIAL_FISHEYE", "50 30 20 0.1 0.2", ("opencv_fisheye", (0.1, 0.2, 0.0, 0.0))),
    ],
)
def test_lenses_of_colmap(tmp_path, model, parameters, expected):
    (tmp_path / "cameras.txt").write_text(f"# comment\n1 {model} 60 40 {parameters}\n")
    (tmp_path / "images.txt").write_text("1 1 0 0 0 1 2 3 1 left.png\n\n2 1 0 0 0 4 2 3 1 right.png\n1 1 -1\n")
    left, right = ColmapConfig().read(tmp_path).cameras
    assert (left.distortion_model, left.distortion) == expected and left.K[0, 0] == 50 and left.K[1, 1] in (50, 51)
    assert left.K[:2, 2].tolist() == [30, 20] and (left.name, right.name) == ("left", "right")
    assert right.world_from_cam[:3, 3].tolist() == [-4, -2, -3]


def test_nerfstudio_is_our_export(capture, tmp_path):
    folder = export(capture, tmp_path, "nerfstudio")
    assert isinstance(recognise(folder), NerfstudioConfig)
    found = NerfstudioConfig().read(folder)
    assert_same(found, capture.cameras)
    assert found.cameras[0].masks[0] == f"masks/{found.cameras[0].name}/000000.png"


def test_nerfstudio_has_lenses_at_the_top(tmp_path):
    top = {"camera_model": "OPENCV", "fl_x": 50.0, "cx": 30.0, "cy": 20.0, "w": 60, "h": 40, "k1": 0.1, "p2": -0.1}
    frame = {"file_path": "./images/a.png", "transform_matrix": np.eye(4).tolist()}
    (tmp_path / "transforms.json").write_text(json.dumps({**top, "frames": [frame]}))
    (camera,) = NerfstudioConfig(pixel_centre=0.0).read(tmp_path).cameras
    assert camera.distortion == (0.1, 0.0, 0.0, -0.1, 0.0) and camera.name == "a"
    assert camera.K.tolist() == [[50, 0, 30.5], [0, 50, 20.5], [0, 0, 1]]
    np.testing.assert_array_equal(camera.world_from_cam, np.diag([1.0, -1, -1, 1]))


@pytest.mark.parametrize("suffix", [".yml", ".json"])
def test_files_of_opencv(lensed, tmp_path, suffix):
    folder = calibration_files.write_opencv(lensed, tmp_path / "calibration", suffix)
    assert isinstance(recognise(folder), OpencvConfig)
    assert_same(OpencvConfig().read(folder), lensed)


def test_opencv_of_several_cameras_in_one_file(capture, tmp_path):
    listed = [
        {
            "name": camera.name,
            "K": camera.K.tolist(),
            "width": camera.width,
            "height": camera.height,
            "world_from_cam": camera.world_from_cam.tolist(),
        }
        for camera in capture.cameras
    ]
    path = tmp_path / "rig.json"
    path.write_text(json.dumps({"cameras": listed}))
    assert_same(OpencvConfig(pixel_centre=0.5).read(path), capture.cameras)
    path.write_text(json.dumps({one.pop("name"): one for one in listed}))
    assert_same(OpencvConfig(pixel_centre=0.5).read(path), capture.cameras)


def test_the_chain_of_kalibr(lensed, tmp_path):
    path = calibration_files.write_kalibr(lensed, tmp_path / "camchain.yaml")
    assert isinstance(recognise(path), KalibrConfig)
    found = KalibrConfig(names=tuple(camera.name for camera in lensed)).read(path)
    assert not found.upright
    np.testing.assert_array_equal(found.cameras[0].world_from_cam, np.eye(4))
    assert_same(found, lensed, moved=lensed[0].world_from_cam)


def test_keys_of_kalibr_that_are_no_text_are_passed_over(lensed, tmp_path):
    path = calibration_files.write_kalibr(lensed, tmp_path / "camchain.yaml")
    path.write_text(path.read_text() + "true: 1\n7: 2\n")
    assert len(KalibrConfig().read(path).cameras) == len(lensed)


def test_kalibr_by_way_of_the_imu(lensed, tmp_path):
    path = calibration_files.write_kalibr(lensed, tmp_path / "camchain.yaml")
    chain = yaml.safe_load(path.read_text())
    for index, camera in enumerate(lensed):
        chain[f"cam{index}"].pop("T_cn_cnm1", None)
        chain[f"cam{index}"]["T_cam_imu"] = np.linalg.inv(camera.world_from_cam).tolist()
        chain[f"cam{index}"]["timeshift_cam_imu"] = 0.01 * index + 0.5
    path.write_text(yaml.safe_dump(chain))
    found = KalibrConfig(names=tuple(camera.name for camera in lensed)).read(path)
    assert_same(found, lensed, moved=lensed[0].world_from_cam)
    assert [round(camera.time_offset_s, 9) for camera in found.cameras] == [0.0, 0.01, 0.02]


@pytest.mark.parametrize("centred", [False, True])
def test_projection_matrices(capture, tmp_path, centred):
    folder = calibration_files.write_projections(capture.cameras, tmp_path / "mv3dt", centred=centred)
    assert isinstance(recognise(folder), ProjectionsConfig)
    found = ProjectionsConfig().read(folder)
    assert all(camera.from_centre is centred for camera in found.cameras)
    expected = capture.cameras
    if centred:
        shift = np.array([[0.0, 0, c.width / 2] for c in expected[:1]] + [[0, 0, expected[0].height / 2], [0, 0, 0]])
        expected = [dataclasses.replace(camera, K=camera.K - shift) for camera in expected]
    assert_same(found, expected, atol=1e-8)


def flight(frames=40):
    """A climbing turn about the balls' place."""
    t = np.linspace(0, 1, frames)
    return np.stack([0.8 * np.sin(5 * t), 0.6 * np.cos(4 * t), 0.7 * t - 0.3], axis=1)


@pytest.mark.parametrize("starts", [[0.0, 0.0, 0.0], [0.0, -12.0, 7.0]])
def test_the_public_drone_layout(lensed, tmp_path, starts):
    folder = calibration_files.write_drone_tracking(lensed, tmp_path / "drone", flight(), starts=starts)
    assert isinstance(recognise(folder), DroneTrackingConfig)
    found = DroneTrackingConfig().read(folder)
    assert_same(found, lensed, atol=1e-4)
    assert "begins at 0.000 s" in found.notes[0] or "begins at -0.000 s" in found.notes[0]
    late = [camera.time_offset_s for camera in found.cameras]
    np.testing.assert_allclose(late, -np.array(starts) / 30 + max(starts) / 30, atol=1e-12)


def test_bags_of_ros(lensed, tmp_path):
    pytest.importorskip("rosbags", reason="rosbags is missing; pip install 'aerojax[ros]'")
    bag = calibration_files.write_bag(lensed, tmp_path / "bag", [[], [], []], 30.0)
    assert isinstance(recognise(bag), RosConfig)
    assert_same(RosConfig().read(bag), lensed)
    with pytest.raises(UserError, match="odom is not above") as refused:
        RosConfig(world_frame="odom").read(bag)
    assert refused.value.code == "missing"


GOOD = {"K": np.eye(3).tolist(), "width": 4, "height": 3, "R": np.eye(3).tolist(), "t": [0, 0, 1]}


@pytest.mark.parametrize(
    ("name", "content", "code", "named"),
    [
        ("a.json", "{", "unreadable", "not valid JSON"),
        ("a.yml", "a: [", "unreadable", "not valid YAML"),
        ("a.yml", "a: !!python/object:os.system {}", "unreadable", "not valid YAML"),
        ("a.json", "{}", "missing", "camera_matrix"),
        ("a.json", json.dumps({**GOOD, "t": [0, 1]}), "invalid", "a: a.t".replace("a: ", "")),
        ("a.json", json.dumps({**GOOD, "R": (2 * np.eye(3)).tolist()}), "invalid", "scales or shears"),
        ("a.json", json.dumps({**GOOD, "R": np.diag([1, 1, -1]).tolist()}), "invalid", "mirrors"),
        ("a.json", json.dumps({**GOOD, "K": (-np.eye(3)).tolist()}), "invalid", "focal lengths"),
        ("a.json", json.dumps({**GOOD, "D": [1, 2, 3]}), "invalid", "3 distortion coefficients"),
        ("a.json", json.dumps({**GOOD, "width": 4.5}), "invalid", "width"),
        ("a.json", json.dumps({**GOOD, "K": ["x"] * 9}), "invalid", "must be numbers"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, name, content, code, named):
    (tmp_path / name).write_text(content)
    with pytest.raises(UserError, match=named) as refused:
        OpencvConfig().read(tmp_path)
    assert refused.value.code == code and str(tmp_path) in refused.value.problem


def test_lists_within_lists_do_not_fill_the_memory(tmp_path, monkeypatch):
    """Anchors double the list forty times; what is read of it is bounded."""
    monkeypatch.setattr("aerojax.capture.imports.calibration.documents._MOST_NUMBERS", 10_000)
    lines = ["a0: &a0 [0, 0]", *(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]" for i in range(1, 41)), "K: *a40"]
    (tmp_path / "bomb.yml").write_text("\n".join(lines))
    with pytest.raises(UserError, match="K must be numbers") as refused:
        OpencvConfig().read(tmp_path)
    assert refused.value.code == "invalid"


def test_a_camera_that_moves_is_refused(tmp_path):
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 60 40 50 50 30 20\n")
    (tmp_path / "images.txt").write_text("1 1 0 0 0 0 0 0 1 a/0.png\n\n2 1 0 0 0 1 0 0 1 a/1.png\n\n")
    with pytest.raises(UserError, match=r"camera a moves by 0\.5") as refused:
        ColmapConfig().read(tmp_path)
    assert refused.value.code == "mismatch"


def test_damaged_binary_models_are_refused(capture, tmp_path):
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is missing; see requirements.clients.lock")
    model = pycolmap.Reconstruction(str(export(capture, tmp_path, "colmap") / "sparse/0"))
    (tmp_path / "binary").mkdir()
    model.write_binary(str(tmp_path / "binary"))
    content = (tmp_path / "binary/images.bin").read_bytes()
    for cut in (0, 5, 60, len(content) - 3):
        (tmp_path / "binary/images.bin").write_bytes(content[:cut])
        with pytest.raises(UserError, match="cut short") as refused:
            ColmapConfig().read(tmp_path / "binary")
        assert refused.value.code == "unreadable"
