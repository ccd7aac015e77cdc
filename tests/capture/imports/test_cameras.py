"""Calibrated cameras and their images as a capture: found, numbered, placed and scaled."""

from __future__ import annotations

import shutil

import cv2
import numpy as np
import pytest
from support import calibration_files
from support.export_examples import write_balls

from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_mask, read_rgb
from aerojax.capture.imports.calibration.kalibr import KalibrConfig
from aerojax.capture.imports.calibration.opencv import OpencvConfig
from aerojax.capture.imports.calibration.ros import RosConfig, extract_images
from aerojax.capture.imports.cameras import CameraImport, WorldConfig, import_cameras
from aerojax.core.errors import UserError
from aerojax.geometry.geodesy import GeographicOrigin

SETTINGS = CameraImport(fps=30.0)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A capture, its cameras as files of OpenCV, and its frames without `capture.json`."""
    folder = tmp_path_factory.mktemp("balls")
    capture = write_balls(folder / "capture")
    calibration_files.write_opencv(capture.cameras, folder / "calibration")
    return capture, folder


@pytest.fixture
def images(kept, tmp_path):
    """A copy of the capture's frames."""
    capture, _ = kept
    shutil.copytree(capture.folder, tmp_path / "images", ignore=shutil.ignore_patterns("*.json"))
    return tmp_path / "images"


def bring(kept, images, out, settings=SETTINGS, **more):
    return import_cameras(OpencvConfig().read(kept[1] / "calibration"), images, out, settings, **more).capture


def assert_same_frames(back, capture):
    assert (back.fps, back.frames) == (capture.fps, capture.frames)
    for index, (one, other) in enumerate(zip(back.cameras, capture.cameras, strict=True)):
        np.testing.assert_allclose(one.K, other.K, atol=1e-9)
        np.testing.assert_allclose(one.world_from_cam, other.world_from_cam, atol=1e-9)
        for frame in range(capture.frames):
            np.testing.assert_array_equal(read_rgb(back, index, frame), read_rgb(capture, index, frame))
            np.testing.assert_array_equal(read_mask(back, index, frame), read_mask(capture, index, frame))


@pytest.mark.parametrize("place", ["auto", "hardlink", "copy", "link", "absolute"])
def test_images_come_however_they_are_placed(kept, images, tmp_path, place):
    back = bring(kept, images, tmp_path / "new/out", CameraImport(fps=30.0, place=place))
    assert_same_frames(back, kept[0])
    assert read_capture(tmp_path / "new/out").outside is (place in ("link", "absolute"))
    assert any("outside" in warning for warning in back.warnings) is back.outside


def test_beside_the_images_nothing_is_copied(kept, images):
    before = sorted(path for path in images.rglob("*"))
    back = bring(kept, images, images)
    assert_same_frames(back, kept[0])
    assert sorted(images.rglob("*")) == sorted([*before, images / "capture.json"])
    with pytest.raises(UserError, match="there is a capture already") as refused:
        bring(kept, images, images)
    assert refused.value.code == "occupied"


def test_files_outside_are_refused_unless_the_capture_says_so(kept, images, tmp_path):
    bring(kept, images, tmp_path / "out", CameraImport(fps=30.0, place="link"))
    path = tmp_path / "out/capture.json"
    path.write_text(path.read_text().replace('"outside": true', '"outside": false'))
    with pytest.raises(UserError, match="links out of the capture's folder"):
        read_capture(tmp_path / "out")


def test_numbers_that_begin_elsewhere_are_renumbered(kept, images, tmp_path):
    for camera in kept[0].cameras:
        for kind in ("rgb", "mask"):
            for path in sorted((images / camera.name / kind).glob("*.png"), reverse=True):
                path.rename(path.with_name(f"img-{int(path.stem) + 7}_{kind}.png"))
    assert_same_frames(bring(kept, images, tmp_path / "out"), kept[0])
    with pytest.raises(UserError, match="not numbered from 0") as refused:
        bring(kept, images, images, CameraImport(fps=30.0, place="beside"))
    assert refused.value.code == "invalid" and not (images / "capture.json").exists()


def test_time_stamps_are_put_in_order(kept, images, tmp_path):
    for camera in kept[0].cameras:
        for kind in ("rgb", "mask"):
            for path in (images / camera.name / kind).glob("*.png"):
                path.rename(path.with_name(f"{1403636579763555584 + int(path.stem) * 33_333_333}.png"))
    assert_same_frames(bring(kept, images, tmp_path / "out"), kept[0])


def test_masks_from_a_folder_of_their_own(kept, images, tmp_path):
    for camera in kept[0].cameras:
        shutil.move(images / camera.name / "mask", tmp_path / "masks" / camera.name)
    assert bring(kept, images, tmp_path / "without").cameras[0].mask is None
    assert_same_frames(bring(kept, images, tmp_path / "out", masks=tmp_path / "masks"), kept[0])


def write_video(path, pictures, fps=25.0):
    height, width = pictures[0].shape[:2]
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), fps, (width, height))
    for picture in pictures:
        writer.write(picture)
    writer.release()


def test_videos_bring_their_rate(kept, tmp_path):
    capture, _ = kept
    for camera in capture.cameras:
        files = sorted((capture.folder / camera.name / "rgb").glob("*.png"))
        write_video(tmp_path / f"videos/{camera.name}.avi", [cv2.imread(str(file)) for file in files])
    back = bring(kept, tmp_path, tmp_path / "out", CameraImport())
    assert (back.fps, back.frames) == (25.0, capture.frames) and back.cameras[0].rgb.endswith("video.avi")
    assert np.abs(read_rgb(back, 1, 2) - read_rgb(capture, 1, 2)).mean() < 0.02
    beside = bring(kept, tmp_path / "videos", tmp_path / "videos", CameraImport())
    assert beside.cameras[0].rgb == f"{capture.cameras[0].name}.avi"


def test_a_calibration_of_another_size_is_scaled(kept, images, tmp_path):
    capture, _ = kept
    for path in images.rglob("*.png"):
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(path), cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_NEAREST))
    made = import_cameras(OpencvConfig().read(kept[1] / "calibration"), images, tmp_path / "out", SETTINGS)
    np.testing.assert_allclose(made.capture.cameras[0].K[:2], capture.cameras[0].K[:2] / 2, atol=1e-9)
    assert all("K was scaled" in note for note in made.notes) and len(made.notes) == 3
    path = images / capture.cameras[1].name / "rgb/000000.png"
    cv2.imwrite(str(path), np.zeros((100, 100, 3), np.uint8))
    with pytest.raises(UserError, match="calibrate the images as they are") as refused:
        bring(kept, images, tmp_path / "other")
    assert refused.value.code == "mismatch" and not (tmp_path / "other").exists()


def test_a_network_without_a_world_stands_upright(kept, images, tmp_path):
    capture, _ = kept
    names = tuple(camera.name for camera in capture.cameras)
    chain = KalibrConfig(names=names).read(calibration_files.write_kalibr(capture.cameras, tmp_path / "chain.yaml"))
    level = import_cameras(chain, images, tmp_path / "level", SETTINGS).capture.cameras
    np.testing.assert_allclose(level[0].world_from_cam[:3, :3], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12)
    apart = np.linalg.norm(level[0].world_from_cam[:3, 3] - level[2].world_from_cam[:3, 3])
    expected = np.linalg.norm(capture.cameras[0].world_from_cam[:3, 3] - capture.cameras[2].world_from_cam[:3, 3])
    np.testing.assert_allclose(apart, expected)
    world = WorldConfig(world_from_source=calibration_files.kalibr_world(capture.cameras))
    back = import_cameras(chain, images, tmp_path / "placed", CameraImport(fps=30.0, world=world)).capture
    assert_same_frames(back, capture)


def test_units_are_scaled_and_the_origin_is_kept(kept, images, tmp_path):
    origin = GeographicOrigin(47.37, 8.54, 408.0)
    settings = CameraImport(fps=30.0, world=WorldConfig(metres_per_unit=0.01), origin=origin, frames=2)
    back = bring(kept, images, tmp_path / "out", settings)
    for one, other in zip(back.cameras, kept[0].cameras, strict=True):
        np.testing.assert_allclose(one.world_from_cam[:3, 3], 0.01 * other.world_from_cam[:3, 3], atol=1e-12)
    assert read_capture(tmp_path / "out").origin == origin and back.frames == 2


@pytest.mark.parametrize(
    ("settings", "code", "named"),
    [
        (CameraImport(), "missing", "set fps="),
        (CameraImport(fps=-1.0), "out-of-range", "fps=-1"),
        (CameraImport(fps=30.0, world=WorldConfig(metres_per_unit=0.0)), "out-of-range", "metres_per_unit=0"),
        (CameraImport(fps=30.0, world=WorldConfig(world_from_source=(1.0,))), "invalid", "1 numbers, not 16"),
    ],
)
def test_settings_that_cannot_be_are_named(kept, images, tmp_path, settings, code, named):
    with pytest.raises(UserError, match=named) as refused:
        bring(kept, images, tmp_path / "out", settings)
    assert refused.value.code == code and sorted(p.name for p in tmp_path.iterdir()) == ["images"]


def test_a_camera_without_images_is_named(kept, images, tmp_path):
    shutil.rmtree(images / kept[0].cameras[1].name)
    with pytest.raises(UserError, match=f"camera {kept[0].cameras[1].name}") as refused:
        bring(kept, images, tmp_path / "out")
    assert refused.value.code == "missing"


def test_a_bag_brings_its_images(kept, tmp_path):
    pytest.importorskip("rosbags", reason="rosbags is missing; pip install 'aerojax[ros]'")
    capture, _ = kept
    pictures = [
        [cv2.imread(str(path)) for path in sorted((capture.folder / camera.name / "rgb").glob("*.png"))]
        for camera in capture.cameras
    ]
    bag = calibration_files.write_bag(capture.cameras, tmp_path / "bag", pictures, 30.0)
    assert extract_images(bag, tmp_path / "images", 30.0) == capture.frames
    back = import_cameras(RosConfig().read(bag), tmp_path / "images", tmp_path / "out", SETTINGS).capture
    assert back.frames == capture.frames
    for index, camera in enumerate(capture.cameras):
        np.testing.assert_allclose(back.cameras[index].world_from_cam, camera.world_from_cam, atol=1e-9)
        np.testing.assert_array_equal(read_rgb(back, index, 2), read_rgb(capture, index, 2))
