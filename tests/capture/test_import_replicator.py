"""Recordings of Isaac Replicator as captures: there and back again, the other layouts and units, and every refusal."""

from __future__ import annotations

import json
import shutil

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.export_examples import BALLS, FRAMES, moved, write_balls

from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_depth, read_mask, read_rgb
from aerojax.capture.imports.recording import segment_number
from aerojax.capture.imports.replicator import ReplicatorImport, import_replicator
from aerojax.core.errors import UserError
from aerojax.data.exports.export import export_dataset
from aerojax.data.exports.sources import ExportOptions, find_sequences

SETTINGS = ReplicatorImport(fps=30.0)
CAMERAS = ("cam_01", "cam_02", "cam_03")


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A capture and its export."""
    folder = tmp_path_factory.mktemp("replicator")
    write_balls(folder / "balls")
    export_dataset(find_sequences(folder / "balls"), "replicator", folder, ExportOptions())
    return folder


@pytest.fixture
def recording(kept, tmp_path):
    """A copy of the export that a test may damage."""
    return shutil.copytree(kept / "replicator/all/balls", tmp_path / "recording")


def change_json(recording, pattern, change):
    """Apply `change` to the content of every file that matches."""
    paths = sorted(recording.glob(pattern))
    assert paths
    for path in paths:
        content = json.loads(path.read_text())
        path.write_text(json.dumps(change(content) or content))


def test_there_and_back_again(kept, tmp_path):
    before = read_capture(kept / "balls")
    import_replicator(kept / "replicator/all/balls", tmp_path / "back", SETTINGS)
    after = read_capture(tmp_path / "back")
    assert (after.fps, after.frames) == (before.fps, before.frames)
    for index, (one, other) in enumerate(zip(before.cameras, after.cameras, strict=True)):
        assert (one.name, one.width, one.height) == (other.name, other.width, other.height)
        np.testing.assert_allclose(other.K, one.K, rtol=1e-12)
        np.testing.assert_allclose(other.world_from_cam, one.world_from_cam, atol=1e-12)
        for frame in range(FRAMES):
            for read in (read_rgb, read_mask, read_depth):
                np.testing.assert_array_equal(read(after, index, frame), read(before, index, frame))
    for one, other in zip(before.truth.objects, after.truth.objects, strict=True):
        assert (one.object_id, one.class_name) == (other.object_id, other.class_name)
        assert "estimated" in other.source
        for state, again in zip(one.frames, other.frames, strict=True):
            assert (dict(again.bbox), dict(again.visible)) == (dict(state.bbox), dict(state.visible))
            # Estimates lie on the seen surface, within a radius of the centre.
            assert np.linalg.norm(np.subtract(state.position, again.position)) < BALLS[one.object_id][2]


def test_triangulated_without_depth(kept, recording, tmp_path):
    for folder in recording.glob("*/distance_to_image_plane"):
        shutil.rmtree(folder)
    capture = import_replicator(recording, tmp_path / "back", SETTINGS)
    assert all(camera.depth is None for camera in capture.cameras)
    # Seen whole by all three cameras, the second ball is found to a fraction of a pixel (2 cm).
    for state in capture.truth.objects[1].frames[1:]:
        assert np.linalg.norm(np.subtract(state.position, moved(2, state.frame, 0.0))) < 0.03


def test_distances_along_rays_become_depths(kept, recording, tmp_path):
    plane = read_capture(kept / "balls")
    for index, camera in enumerate(plane.cameras):
        u, v = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
        rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.K).T
        folder = recording / camera.name
        shutil.rmtree(folder / "distance_to_image_plane")
        (folder / "distance_to_camera").mkdir()
        for frame in range(FRAMES):
            depth = read_depth(plane, index, frame)
            distance = np.where(depth > 0, depth * np.linalg.norm(rays, axis=-1), np.inf).astype(np.float32)
            np.save(folder / f"distance_to_camera/distance_to_camera_{frame:04d}.npy", distance)
    back = import_replicator(recording, tmp_path / "back", SETTINGS)
    for index in range(3):
        np.testing.assert_allclose(read_depth(back, index, 1), read_depth(plane, index, 1), rtol=1e-6)


def test_flat_folders_and_colours(kept, tmp_path):
    export_dataset(
        find_sequences(kept / "balls"), "replicator", tmp_path, ExportOptions(replicator_layout="flat", depth=False)
    )
    recording = tmp_path / "replicator/all/balls"
    colours = {1: (255, 20, 30, 255), 2: (10, 0, 250, 255)}
    for path in recording.glob("*/instance_segmentation_0*.png"):
        ids = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        image = np.zeros((*ids.shape, 4), np.uint8)
        for number, (red, green, blue, alpha) in colours.items():
            image[ids == number + 1] = (blue, green, red, alpha)
        cv2.imwrite(str(path), image)
    names = {"0": "(0, 0, 0, 0)", "1": "(0, 0, 0, 255)", "2": str(colours[1]), "3": str(colours[2])}
    for kind in ("mapping", "semantics_mapping"):
        change_json(
            recording, f"*/instance_segmentation_{kind}_*.json", lambda c: {names[k]: value for k, value in c.items()}
        )
    back, before = import_replicator(recording, tmp_path / "back", SETTINGS), read_capture(kept / "balls")
    for index in range(3):
        np.testing.assert_array_equal(read_mask(back, index, 1), read_mask(before, index, 1))


def test_keys_of_mappings():
    assert segment_number("7") == 7
    assert segment_number("(1, 2, 3, 255)") == segment_number("(1,2,3,255)") == 0x010203FF
    assert segment_number("drone") is None and segment_number("(1, 2, 3)") is None and segment_number("x7") is None


def test_stages_in_centimetres_with_y_up(kept, recording, tmp_path):
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # y-up from z-up: x, z, -y

    def as_recorded(content):
        view = np.array(content["cameraViewTransform"]).reshape(4, 4)
        view[:3, :3] = turn @ view[:3, :3]
        view[3, :3] *= 100
        return {**content, "cameraViewTransform": view.ravel().tolist(), "metersPerSceneUnit": 0.01}

    change_json(recording, "*/camera_params/*.json", as_recorded)
    back = import_replicator(recording, tmp_path / "back", ReplicatorImport(30.0, up="y"))
    for one, other in zip(read_capture(kept / "balls").cameras, back.cameras, strict=True):
        np.testing.assert_allclose(other.world_from_cam, one.world_from_cam, atol=1e-10)


def test_intrinsics_from_the_aperture(kept, recording, tmp_path):
    def without_projection(content):
        content["cameraProjection"] = [0.0] * 16

    change_json(recording, "*/camera_params/*.json", without_projection)
    back = import_replicator(recording, tmp_path / "back", SETTINGS)
    for one, other in zip(read_capture(kept / "balls").cameras, back.cameras, strict=True):
        assert other.K[0, 0] == pytest.approx(one.K[0, 0]) and other.K[1, 1] == other.K[0, 0]  # square pixels
        assert other.K[0, 2] == pytest.approx(one.K[0, 2])


def test_poses_from_boxes(recording, tmp_path):
    kind = np.dtype([("semanticId", "<u4"), ("x_min", "<f4"), ("transform", "<f4", (4, 4)), ("occlusionRatio", "<f4")])
    turns = Rotation.from_euler("zyx", [[0.3, -0.2, 0.1 * frame] for frame in range(FRAMES)])
    folder = recording / "cam_02/bounding_box_3d"
    folder.mkdir()
    for frame in range(FRAMES):
        rows = np.zeros(2, kind)
        rows["transform"] = np.eye(4)
        for number in BALLS:
            rows["transform"][number - 1, :3, :3] = 2.5 * turns[frame].as_matrix().T  # row vectors, scaled prim
            rows["transform"][number - 1, 3, :3] = moved(number, frame, 0.0)
        np.save(folder / f"bounding_box_3d_{frame:04d}.npy", rows)
        names = ["/World/object_00001_drone", "/World/object_00002_bird"]
        (folder / f"bounding_box_3d_prim_paths_{frame:04d}.json").write_text(json.dumps(names))
    capture = import_replicator(recording, tmp_path / "back", SETTINGS)
    for item in capture.truth.objects:
        assert "3D boxes" in item.source
        for state in item.frames:
            np.testing.assert_allclose(state.position, moved(item.object_id, state.frame, 0.0), atol=1e-6)
            found = Rotation.from_quat(state.orientation_wxyz, scalar_first=True)
            assert (found.inv() * turns[state.frame]).magnitude() < 1e-6


def test_labels_need_classes(recording, tmp_path):
    def relabel(content):
        return {k: {"class": "quadrotor"} if v == {"class": "drone"} else v for k, v in content.items()}

    change_json(recording, "*/*/instance_segmentation_semantics_mapping_*.json", relabel)
    with pytest.raises(UserError, match=r"(?s)1 problem.*label 'quadrotor' of /World/object_00001_drone.*set classes="):
        import_replicator(recording, tmp_path / "back", SETTINGS)
    named = import_replicator(recording, tmp_path / "named", ReplicatorImport(30.0, {"quadrotor": "drone"}))
    assert [o.class_name for o in named.truth.objects] == ["drone", "bird"]
    by_prim = {"/World/object_00001_drone": "helicopter", "quadrotor": None}
    assert [
        o.class_name
        for o in import_replicator(recording, tmp_path / "prim", ReplicatorImport(30.0, by_prim)).truth.objects
    ] == [
        "helicopter",
        "bird",
    ]
    ignored = import_replicator(recording, tmp_path / "ignored", ReplicatorImport(30.0, {"quadrotor": None}))
    assert [(o.object_id, o.class_name) for o in ignored.truth.objects] == [(1, "bird")]
    assert set(np.unique(read_mask(ignored, 0, 0))) == {0, 1}


def set_param(key, value):
    def change(recording):
        change_json(recording, "cam_02/camera_params/camera_params_0001.json", lambda c: {**c, key: value})

    return change


def remove(pattern):
    def change(recording):
        for path in recording.glob(pattern):
            shutil.rmtree(path) if path.is_dir() else path.unlink()

    return change


def write(path, data):
    return lambda recording: (recording / path).write_bytes(data)


def small_picture(recording):
    cv2.imwrite(str(recording / "cam_01/rgb/rgb_0001.png"), np.zeros((20, 30, 3), np.uint8))


MOVED = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -5, 1]
PROBLEMS = {
    "two cameras": (remove("cam_03"), "2 cameras found, a capture needs at least 3"),
    "no camera": (remove("cam_*"), "0 cameras found"),
    "no parameters": (remove("cam_01/camera_params"), "cam_01: has no camera_params"),
    "moving camera": (set_param("cameraViewTransform", MOVED), r"camera_params_0001.json: the camera has moved"),
    "scaled camera": (set_param("cameraViewTransform", [2.0] * 16), "cameraViewTransform: has scale or shear"),
    "fisheye": (set_param("cameraModel", "fisheyePolynomial"), "cameraModel: is 'fisheyePolynomial', only pinhole"),
    "short matrix": (set_param("cameraViewTransform", [1.0]), "cameraViewTransform: must be a list of 16"),
    "unit": (set_param("metersPerSceneUnit", -1), "metersPerSceneUnit: must be positive"),
    "focal length": (set_param("cameraFocalLength", 99.0), "cameraProjection: means fx = 420.0 px, cameraFocalLength"),
    "no matrix": (set_param("cameraProjection", [1.0] * 16), "is no perspective projection"),
    "broken json": (write("cam_02/camera_params/camera_params_0002.json", b"{"), "is not valid JSON"),
    "lost frame": (remove("cam_02/rgb/rgb_0001.png"), "rgb lacks 1 of 3 frames, the first is 1"),
    "gap": (remove("*/rgb/rgb_0001.png"), "frame numbers have gaps"),
    "lost depth": (remove("cam_01/*/distance_to_image_plane_0002.npy"), "distance_to_image_plane lacks 1 of 3"),
    "lost mapping": (
        remove("cam_01/*/instance_segmentation_mapping_0002.json"),
        "has no instance_segmentation_mapping",
    ),
    "damaged picture": (write("cam_03/rgb/rgb_0000.png", b"\x89PNG"), "damaged or cut short"),
    "pickle": (
        write("cam_01/distance_to_image_plane/distance_to_image_plane_0000.npy", b"\x80\x04."),
        "no.* NumPy array",
    ),
    "small picture": (small_picture, "is 30×20 pixels, camera_params says 320×240"),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_problems_are_named(recording, tmp_path, name):
    damage, named = PROBLEMS[name]
    damage(recording)
    with pytest.raises(UserError, match=named):
        import_replicator(recording, tmp_path / "back", SETTINGS)
    assert [path.name for path in tmp_path.iterdir()] == ["recording"]  # nothing is left behind


def test_problems_come_together(recording, tmp_path):
    for name in ("fisheye", "lost frame", "lost mapping"):
        PROBLEMS[name][0](recording)
    with pytest.raises(UserError) as caught:
        import_replicator(recording, tmp_path / "back", SETTINGS)
    assert all(
        word in str(caught.value)
        for word in ("3 problems", "cameraModel", "rgb lacks", "instance_segmentation_mapping")
    )


def test_refusals_before_reading(kept, tmp_path):
    recording = kept / "replicator/all/balls"
    with pytest.raises(UserError, match="exists already"):
        import_replicator(recording, tmp_path, SETTINGS)
    with pytest.raises(UserError, match="fps=0 must be positive"):
        import_replicator(recording, tmp_path / "back", ReplicatorImport(fps=0.0))
    with pytest.raises(UserError, match="drone: unknown class 'jet'"):
        import_replicator(recording, tmp_path / "back", ReplicatorImport(30.0, {"drone": "jet"}))
