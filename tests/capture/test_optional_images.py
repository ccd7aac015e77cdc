"""Optional images and truth of a capture: coverage, normals, flow; what cameras see of an object; joints."""

from __future__ import annotations

import dataclasses
import json
import shutil

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.broken_captures import HEIGHT, WIDTH, frame_images, make_camera, make_good

from aerojax.capture.format import Capture, JointPose, read_capture, rotate_world, write_capture_json
from aerojax.capture.frames import read_coverage, read_flow, read_normal
from aerojax.capture.lenses import distort_points
from aerojax.capture.validate.examination import problems
from aerojax.capture.write import FrameExtras, write_frame
from aerojax.core.errors import UserError
from aerojax.geometry.boxes_3d import AlignedBox, OrientedBox

PATTERNS = {
    "coverage": "{name}/coverage/{{frame:06d}}.png",
    "normal": "{name}/normal/{{frame:06d}}.png",
    "flow": "{name}/flow/{{frame:06d}}.tiff",
}
SEEN = {
    "truncated": {"cam_01": False, "cam_02": True},
    "visibility": {"cam_01": 0.75, "cam_02": 1.0},
    "projected_box": {"cam_01": (7.5, 5.25, 24.0, 18.5), "cam_02": (-3.0, 2.0, 40.0, 30.0)},
    "surface_centroid": {"cam_01": (0.1, -0.2, 0.3)},
    "projected_corners": {"cam_02": tuple((0.5 * k, 40.0 - k) for k in range(8))},
    "oriented_box": OrientedBox((1.0, 2.0, 3.0), (0.4, 0.5, 0.6)),
    "aligned_box": AlignedBox((0.5, 1.5, 2.5), (1.5, 2.5, 3.5)),
}
JOINTS = {
    "wing": JointPose((0.1, 0.2, 0.3), (0.6, 0.0, 0.8, 0.0)),
    "tail": JointPose((1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
}


def extras(camera: int, frame: int) -> FrameExtras:
    rng = np.random.default_rng(10 * camera + frame)
    coverage = rng.integers(0, 256, (HEIGHT, WIDTH)).astype(np.uint8)
    normal = rng.normal(size=(HEIGHT, WIDTH, 3)).astype(np.float32)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    normal[coverage < 100] = 0
    flow = rng.normal(size=(HEIGHT, WIDTH, 2)).astype(np.float32)
    return FrameExtras(coverage, normal, flow)


@pytest.fixture
def capture(tmp_path) -> Capture:
    made = make_good(tmp_path / "capture")
    cameras = tuple(
        dataclasses.replace(c, **{kind: pattern.format(name=c.name) for kind, pattern in PATTERNS.items()})
        for c in made.cameras
    )
    (flown,) = made.truth.objects
    states = tuple(dataclasses.replace(state, **SEEN, joints=JOINTS) for state in flown.frames)
    truth = dataclasses.replace(made.truth, objects=(dataclasses.replace(flown, frames=states),))
    full = dataclasses.replace(made, cameras=cameras, truth=truth)
    for index, camera in enumerate(cameras):
        for frame in range(full.frames):
            write_frame(full.folder, camera, frame, *frame_images(index, frame), extra=extras(index, frame))
    write_capture_json(full, overwrite=True)
    return full


def test_everything_comes_back(capture):
    read = read_capture(capture.folder)
    assert read.truth == capture.truth
    for index, camera in enumerate(read.cameras):
        assert (camera.coverage, camera.normal, camera.flow) == tuple(
            p.format(name=camera.name) for p in PATTERNS.values()
        )
        for frame in range(read.frames):
            written = extras(index, frame)
            np.testing.assert_allclose(read_coverage(read, index, frame) * 255, written.coverage, atol=1e-4)
            np.testing.assert_allclose(read_normal(read, index, frame), written.normal, atol=5e-5)
            np.testing.assert_array_equal(read_flow(read, index, frame), written.flow)


def test_normals_are_stored_as_rgb(tmp_path):
    camera = make_camera(0, mask=None, depth=None, normal="normal/{frame}.png")
    normal = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    normal[2, 3] = (1, 0, -1)
    write_frame(tmp_path, camera, 0, np.zeros((HEIGHT, WIDTH, 3), np.uint8), extra=FrameExtras(normal=normal))
    stored = cv2.imread(str(tmp_path / "normal/0.png"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert stored[2, 3].tolist() == [65535, 32768, 0]  # (0 + 1)/2·65535 = 32767.5 rounds to even
    assert stored.any(axis=2).sum() == 1


def test_empty_optional_fields_are_left_out(tmp_path):
    make_good(tmp_path)
    text = (tmp_path / "truth.json").read_text() + (tmp_path / "capture.json").read_text()
    assert not [word for word in (*SEEN, "joints", *PATTERNS) if f'"{word}"' in text]
    read = read_capture(tmp_path)
    assert read_coverage(read, 0, 0) is None and read_normal(read, 0, 0) is None and read_flow(read, 0, 0) is None


def test_a_turned_world_turns_centroids_and_joints(capture):
    turn = Rotation.from_euler("zyx", [1.1, -0.4, 2.3])
    turned = rotate_world(capture, turn.as_matrix())
    state = turned.truth.objects[0].frames[1]
    np.testing.assert_allclose(state.surface_centroid["cam_01"], turn.apply([0.1, -0.2, 0.3]), atol=1e-12)
    assert list(state.joints) == ["wing", "tail"]
    np.testing.assert_allclose(state.joints["wing"].position, turn.apply([0.1, 0.2, 0.3]), atol=1e-12)
    w, x, y, z = state.joints["wing"].orientation_wxyz
    expected = (turn * Rotation.from_quat([0.0, 0.8, 0.0, 0.6])).as_matrix()
    np.testing.assert_allclose(Rotation.from_quat([x, y, z, w]).as_matrix(), expected, atol=1e-12)
    np.testing.assert_allclose(state.oriented_box.centre, turn.apply([1.0, 2.0, 3.0]), atol=1e-12)
    assert state.oriented_box.size == (0.4, 0.5, 0.6) and state.aligned_box is None
    assert state.projected_corners == SEEN["projected_corners"]
    assert state.projected_box == SEEN["projected_box"] and state.visibility == SEEN["visibility"]
    assert all(camera.normal is None and camera.flow is not None for camera in turned.cameras)


def test_flow_of_a_lens_ends_where_the_point_does(tmp_path):
    lens = {"distortion_model": "opencv", "distortion": (-0.2, 0.05, 0.001, -0.002)}
    camera = make_camera(0, mask=None, depth=None, flow="flow/{frame}.tiff", **lens)
    stored = np.full((HEIGHT, WIDTH, 2), 1.5, np.float32)
    write_frame(tmp_path, camera, 0, np.zeros((HEIGHT, WIDTH, 3), np.uint8), extra=FrameExtras(flow=stored))
    flow = read_flow(Capture(tmp_path, 30.0, 1, (camera,), None), 0, 0)
    pixel = np.array([[20.5, 9.5]])
    both = np.concatenate([pixel, pixel + flow[9, 20]])
    start, end = distort_points(both, camera.K, camera.distortion_model, camera.distortion)
    np.testing.assert_allclose(end - start, [1.5, 1.5], atol=1e-5)


def _truth_fault(key, value):
    def change(folder):
        raw = json.loads((folder / "truth.json").read_text())
        raw["objects"][0]["frames"][1][key] = value
        (folder / "truth.json").write_text(json.dumps(raw))

    return change


def _image_fault(name, image):
    return lambda folder: cv2.imwrite(str(folder / name), image)


FAULTS = {
    "truncated": (_truth_fault("truncated", {"cam_01": 1}), "frames[1].truncated.cam_01: must be true or false"),
    "truncated camera": (_truth_fault("truncated", {"cam_9": True}), "frames[1].truncated: unknown camera 'cam_9'"),
    "visibility": (_truth_fault("visibility", {"cam_01": 1.2}), "visibility.cam_01: must be a number from 0 to 1"),
    "visibility list": (_truth_fault("visibility", [1]), "frames[1].visibility: must be an object"),
    "projected box": (_truth_fault("projected_box", {"cam_01": [5, 0, 5, 9]}), "projected_box.cam_01: [5.0, 0.0, 5"),
    "centroid": (_truth_fault("surface_centroid", {"cam_01": [0, 1]}), "surface_centroid.cam_01: must be a list of 3"),
    "corners": (_truth_fault("projected_corners", {"cam_01": [[1, 2]]}), "projected_corners.cam_01: has 1 corners"),
    "corner": (
        _truth_fault("projected_corners", {"cam_01": [[1], *[[1, 2]] * 7]}),
        "projected_corners.cam_01[0]: must be a list",
    ),
    "oriented box": (_truth_fault("oriented_box", {"centre": [0, 0, 0]}), "frames[1].oriented_box.size: is missing"),
    "box size": (
        _truth_fault("oriented_box", {"centre": [0, 0, 0], "size": [1, -1, 1]}),
        "frames[1].oriented_box: size [1.0, -1.0, 1.0] is too small",
    ),
    "box ends": (
        _truth_fault("aligned_box", {"low": [0, 0, 2], "high": [1, 1, 1]}),
        "frames[1].aligned_box: high [1.0, 1.0, 1.0] is too small",
    ),
    "joints": (_truth_fault("joints", []), "frames[1].joints: must be an object"),
    "joint key": (_truth_fault("joints", {"a": {"position": [0, 0, 0]}}), "joints.a.orientation_wxyz: is missing"),
    "joint turn": (
        _truth_fault("joints", {"a": {"position": [0, 0, 0], "orientation_wxyz": [1, 1, 0, 0]}}),
        "joints.a.orientation_wxyz: [1.0, 1.0, 0.0, 0.0] is not of unit length",
    ),
    "coverage": (_image_fault("cam_01/coverage/000000.png", np.zeros((HEIGHT, WIDTH), np.uint16)), "grey 8-bit"),
    "normal": (_image_fault("cam_01/normal/000000.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8)), "16-bit RGB"),
    "flow": (_image_fault("cam_01/flow/000000.tiff", np.zeros((HEIGHT, WIDTH), np.float32)), "two channels"),
    "flow missing": (lambda folder: shutil.rmtree(folder / "cam_02/flow"), "the file is missing (and 1 more"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_is_one_clear_problem(capture, name):
    break_it, words = FAULTS[name]
    break_it(capture.folder)
    (problem,) = problems(capture.folder)
    assert words in str(problem) and problem.remedy


@pytest.mark.parametrize(
    ("read", "name", "words"),
    [(read_coverage, "coverage/000000.png", "grey 8-bit"), (read_normal, "normal/000000.png", "16-bit RGB")],
)
def test_images_of_another_kind_are_refused_on_reading(capture, read, name, words):
    cv2.imwrite(str(capture.folder / "cam_01" / name), np.zeros((HEIGHT, WIDTH, 4), np.uint8))
    with pytest.raises(UserError, match=words):
        read(capture, 0, 0)


@pytest.mark.parametrize("keep", [0, 20, 0.5, 0.9])
def test_cut_flow_is_found(capture, keep):
    path = capture.folder / "cam_01/flow/000000.tiff"
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data)) if keep < 1 else keep])
    with pytest.raises(UserError, match="damaged or cut short"):
        read_flow(capture, 0, 0)
