"""Frames as arrays: exact round trips, videos, clocks, and files that break after validation."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.broken_captures import FRAMES, HEIGHT, WIDTH, frame_images, make_camera, make_good, write_video

from aerojax.capture.codecs.video import VideoReader
from aerojax.capture.format import Capture, read_capture, write_capture_json
from aerojax.capture.frames import read_depth, read_mask, read_rgb, source_frame
from aerojax.capture.write import write_frame
from aerojax.core.errors import UserError


def with_camera(capture: Capture, index: int, **changes) -> Capture:
    cameras = list(capture.cameras)
    cameras[index] = dataclasses.replace(cameras[index], **changes)
    return dataclasses.replace(capture, cameras=tuple(cameras))


@pytest.fixture
def capture(tmp_path) -> Capture:
    return make_good(tmp_path / "capture")


def test_frames_come_back_exactly(capture):
    for camera in range(3):
        for frame in range(FRAMES):
            rgb, mask, depth = frame_images(camera, frame)
            np.testing.assert_array_equal(read_rgb(capture, camera, frame), rgb.astype(np.float32) / np.float32(255))
            np.testing.assert_array_equal(read_mask(capture, camera, frame), mask)
            np.testing.assert_array_equal(read_depth(capture, camera, frame), depth)


def test_float_colour_is_rounded_and_clipped(tmp_path):
    rgb = np.full((HEIGHT, WIDTH, 3), 0.5)
    rgb[0, 0], rgb[0, 1] = -1.0, 2.0
    camera = make_camera(0, mask=None, depth=None)
    write_frame(tmp_path, camera, 0, rgb)
    capture = Capture(tmp_path, 30.0, 1, (camera,), None)
    read = np.round(read_rgb(capture, 0, 0) * 255)
    assert read[0, 0, 0] == 0 and read[0, 1, 0] == 255 and read[5, 5, 0] == 128
    assert read_mask(capture, 0, 0) is None and read_depth(capture, 0, 0) is None


@pytest.mark.parametrize(("stored", "expected"), [((0, 255), (0, 1)), ((0, 1), (0, 1)), ((0, 7), (0, 7))])
def test_eight_bit_masks(capture, stored, expected):
    image = np.full((HEIGHT, WIDTH), stored[0], np.uint8)
    image[3:9, 4:8] = stored[1]
    cv2.imwrite(str(capture.folder / "cam_01/mask/000000.png"), image)
    mask = read_mask(capture, 0, 0)
    assert (mask[0, 0], mask[5, 5]) == expected
    assert mask.dtype == np.uint16


def test_sixteen_bit_id_255_stays(capture):
    cv2.imwrite(str(capture.folder / "cam_01/mask/000000.png"), np.full((HEIGHT, WIDTH), 255, np.uint16))
    assert read_mask(capture, 0, 0)[0, 0] == 255


def test_sixteen_bit_colour_keeps_its_depth(capture):
    image = np.full((HEIGHT, WIDTH, 3), 12345, np.uint16)
    cv2.imwrite(str(capture.folder / "cam_01/rgb/000000.png"), image)
    np.testing.assert_allclose(read_rgb(capture, 0, 0), 12345 / 65535, rtol=1e-6)


@pytest.mark.parametrize(("codec", "name"), [("mp4v", "film.mp4"), ("MJPG", "film.avi")])
def test_video_in_any_order(tmp_path, codec, name):
    capture = make_good(tmp_path)
    write_video(tmp_path / name, 6, codec=codec)
    capture = dataclasses.replace(with_camera(capture, 0, rgb=name, mask=None, depth=None), frames=6)
    for frame in (0, 1, 2, 5, 3, 3, 0):
        level = read_rgb(capture, 0, frame).mean() * 255
        assert level == pytest.approx(40 + 30 * frame, abs=4), frame


def test_video_capture_validates_and_follows_a_replaced_file(tmp_path):
    capture = with_camera(make_good(tmp_path), 0, rgb="film.mp4")
    write_video(tmp_path / "film.mp4", 2)
    write_capture_json(capture, overwrite=True)
    assert read_rgb(read_capture(tmp_path), 0, 0).mean() * 255 == pytest.approx(40, abs=4)
    write_video(tmp_path / "film.mp4", 4, (WIDTH, HEIGHT), codec="XVID")
    assert VideoReader(tmp_path / "film.mp4").frame_count() == 4


def test_video_that_ends_early(tmp_path):
    capture = make_good(tmp_path)
    write_video(tmp_path / "film.mp4", 2)
    capture = dataclasses.replace(with_camera(capture, 0, rgb="film.mp4", mask=None, depth=None), frames=6)
    with pytest.raises(
        UserError, match=r"film\.mp4: stops with its picture at 0\.033 s, before 0\.167 s; lower `frames`"
    ) as error:
        read_rgb(capture, 0, 5)
    assert error.value.code == "unreadable"


def test_clock_offsets():
    camera = make_camera(0, time_offset_s=2 / 30)
    early = dataclasses.replace(camera, time_offset_s=-0.049)  # 1.47 frames
    capture = Capture(Path(), 30.0, 5, (camera, early), None)
    assert [source_frame(capture, 0, frame) for frame in range(5)] == [None, None, 0, 1, 2]
    assert [source_frame(capture, 1, frame) for frame in range(5)] == [1, 2, 3, 4, None]


def test_half_frame_offsets_neither_repeat_nor_skip():
    camera = make_camera(0, time_offset_s=0.5 / 30)
    capture = Capture(Path(), 30.0, 5, (camera,), None)
    assert [source_frame(capture, 0, frame) for frame in range(5)] == [0, 1, 2, 3, 4]


def test_late_camera_reads_the_earlier_file(capture):
    late = with_camera(capture, 1, time_offset_s=1 / 30)
    assert read_rgb(late, 1, 0) is None and read_mask(late, 1, 0) is None and read_depth(late, 1, 0) is None
    np.testing.assert_array_equal(read_rgb(late, 1, 1), read_rgb(capture, 1, 0))
    np.testing.assert_array_equal(read_depth(late, 1, 1), read_depth(capture, 1, 0))


@pytest.mark.parametrize("frame", [-1, FRAMES])
def test_frames_outside_the_capture(capture, frame):
    with pytest.raises(IndexError, match=f"frame {frame} of a capture with 2 frames"):
        read_rgb(capture, 0, frame)


@pytest.mark.parametrize("keep", [0, 20, 0.5, 0.9])
@pytest.mark.parametrize(("name", "read"), [("rgb", read_rgb), ("mask", read_mask), ("depth", read_depth)])
def test_files_cut_after_validation(capture, name, read, keep):
    (path,) = (capture.folder / f"cam_02/{name}").glob("000001.*")
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data)) if keep < 1 else keep])
    with pytest.raises(UserError, match=f"{path.name}: the image is damaged or cut short"):
        read(capture, 1, 1)


def test_flipped_bytes_are_found(capture):
    path = capture.folder / "cam_02/rgb/000001.png"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(bytes(data))
    with pytest.raises(UserError, match="damaged"):
        read_rgb(capture, 1, 1)


def test_reading_checks_size_kind_and_place(capture):
    folder = capture.folder
    cv2.imwrite(str(folder / "cam_01/rgb/000000.png"), np.zeros((8, 8, 3), np.uint8))
    with pytest.raises(UserError, match="is 8×8 pixels, camera cam_01 32×24"):
        read_rgb(capture, 0, 0)
    colours = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    colours[:9, :9, 0] = colours[12:, 12:, 1] = 255
    cv2.imwrite(str(folder / "cam_01/mask/000000.png"), colours)
    with pytest.raises(UserError, match="has several colours"):
        read_mask(capture, 0, 0)
    cv2.imwrite(str(folder / "cam_01/depth/000000.tiff"), np.full((HEIGHT, WIDTH), np.nan, np.float32))
    with pytest.raises(UserError, match="finite"):
        read_depth(capture, 0, 0)
    (folder / "cam_01/rgb/000001.png").unlink()
    with pytest.raises(UserError, match="file is missing"):
        read_rgb(capture, 0, 1)
    with pytest.raises(UserError, match="leaves the capture's folder"):
        read_rgb(with_camera(capture, 0, rgb="../{frame}.png"), 0, 0)


def test_writing_checks_size_pairs_and_place(tmp_path):
    camera, (rgb, mask, depth) = make_camera(0), frame_images(0, 0)
    with pytest.raises(UserError, match="rgb is 32×20, the camera 32×24"):
        write_frame(tmp_path, camera, 0, rgb[:20], mask[:20], depth[:20])
    with pytest.raises(UserError, match="a mask pattern without a mask array"):
        write_frame(tmp_path, camera, 0, rgb, None, depth)
    with pytest.raises(UserError, match="a depth array without a depth pattern"):
        write_frame(tmp_path, dataclasses.replace(camera, depth=None), 0, rgb, mask, depth)
    with pytest.raises(UserError, match="absolute path"):
        write_frame(tmp_path, dataclasses.replace(camera, rgb="/x/{frame}.png"), 0, rgb, mask, depth)
    with pytest.raises(UserError, match="is the video"):
        write_frame(tmp_path, dataclasses.replace(camera, rgb="film.mp4"), 0, rgb, mask, depth)
