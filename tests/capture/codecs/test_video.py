"""Pictures of videos by their time: other rates, gaps, lost endings, rotation, codecs that cannot be decoded."""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.broken_captures import HEIGHT, WIDTH, make_good

from aerojax.capture.codecs.video import BrokenVideo, VideoReader, pictures_near
from aerojax.capture.format import Capture, read_capture, write_capture_json
from aerojax.capture.frames import read_frames, read_rgb

SMALL = (64, 48)


def write_film(path: Path, levels: list[int], fps: float, size: tuple[int, int] = SMALL, codec: str = "mp4v") -> None:
    """A video of grey pictures."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), fps, size)
    for level in levels:
        writer.write(np.full((size[1], size[0], 3), level, np.uint8))
    writer.release()


def level_at(video: VideoReader, frame: int, fps: float = 30.0) -> float | None:
    image = video.read_at(frame / fps, 0.5 / fps)
    return None if image is None else float(image.mean())


def filmed(folder: Path, fps: float, count: int, *, frames: int, **changes) -> Capture:
    """The good capture with `frames` frames at 30 a second, whose first camera is a video of grey 40, 48, 56, …"""
    capture = make_good(folder)
    write_film(folder / "film.mp4", [40 + 8 * i for i in range(count)], fps, (WIDTH, HEIGHT))
    first = dataclasses.replace(capture.cameras[0], rgb="film.mp4", mask=None, depth=None, **changes)
    return dataclasses.replace(capture, cameras=(first, *capture.cameras[1:]), frames=frames, truth=None)


def picture(capture: Capture, frame: int) -> int | None:
    """Number of the picture that the video shows at a frame of the capture."""
    image = read_rgb(capture, 0, frame)
    return None if image is None else round((float(image.mean()) * 255 - 40) / 8)


@pytest.mark.parametrize(
    ("fps", "expected"),
    [
        (30.0, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        (15.0, [0, None, 1, None, 2, None, 3, None, 4, None]),
        (10.0, [0, None, None, 1, None, None, 2, None, None, 3]),
        (60.0, [0, 2, 4, 6, 8, 10, 12, 14, 16, 18]),
        (25.0, [0, 1, 2, None, 3, 4, 5, 6, 7, None]),
    ],
)
def test_pictures_are_taken_by_time(tmp_path, fps, expected):
    capture = filmed(tmp_path, fps, 24, frames=10)
    # At 25 a second frame 3 lies 20 ms from both pictures, more than half a frame; so do 9 and every sixth.
    assert [picture(capture, frame) for frame in range(10)] == expected


@pytest.mark.parametrize(
    ("offset_s", "expected"),
    [(2 / 30, [None, None, 0, 1, 2, 3]), (-2 / 30, [2, 3, 4, 5, 6, 7]), (0.4 / 30, [0, 1, 2, 3, 4, 5])],
)
def test_offsets_of_the_clock_shift_times(tmp_path, offset_s, expected):
    capture = filmed(tmp_path, 30.0, 12, frames=10, time_offset_s=offset_s)
    assert [picture(capture, frame) for frame in range(6)] == expected


def test_a_gap_is_a_missing_view_and_says_so(tmp_path):
    capture = filmed(tmp_path, 15.0, 24, frames=2)
    assert read_frames(capture, 0).missing == ()
    (missing,) = read_frames(capture, 1).missing
    assert missing.camera == 0 and "film.mp4: has no picture within half a frame of 0.033 s" in missing.text


def test_other_rates_are_said_by_validation(tmp_path):
    write_capture_json(filmed(tmp_path, 15.0, 24, frames=2), overwrite=True)
    (warning,) = read_capture(tmp_path).warnings
    assert "has 24 frames at 15 a second, the capture 2 frames at 30 a second" in warning


def test_a_capture_that_refuses_gaps_names_them(tmp_path):
    write_capture_json(dataclasses.replace(filmed(tmp_path, 15.0, 24, frames=2), missing="refuse"), overwrite=True)
    with pytest.raises(ValueError, match=r"has 24 frames, which show 1 of the capture's 2"):
        read_capture(tmp_path)


def test_pictures_near_counts_ends_and_gaps():
    times = (0.0, 0.1, 0.4)
    asked = np.array([-0.2, -0.04, 0.05, 0.1, 0.25, 0.36, 0.44, 0.6])
    np.testing.assert_array_equal(
        pictures_near(times, asked, 0.05), [False, True, True, True, False, True, True, False]
    )
    assert not pictures_near((), asked, 0.05).any()


def turned(path: Path, matrix: tuple[int, ...]) -> None:
    """Write another display matrix (ISO 14496-12, §8.3.2) into the track header of an MP4."""
    data = bytearray(path.read_bytes())
    start = data.index(b"tkhd") + 4 + 40
    data[start : start + 36] = struct.pack(">9i", *matrix)
    path.write_bytes(bytes(data))


@pytest.mark.parametrize("degrees", [90, 180])
def test_rotation_in_the_metadata_is_not_applied(tmp_path, degrees):
    path = tmp_path / "film.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, SMALL)
    image = np.full((SMALL[1], SMALL[0], 3), 40, np.uint8)
    image[:16, :16] = 220
    for _ in range(3):
        writer.write(image)
    writer.release()
    plain = VideoReader(path).read_at(0.0, 0.01)
    one, w, h = 0x10000, SMALL[0] << 16, SMALL[1] << 16
    turned(path, (0, one, 0, -one, 0, 0, h, 0, 1 << 30) if degrees == 90 else (-one, 0, 0, 0, -one, 0, w, h, 1 << 30))
    video = VideoReader(path)
    assert (video.width, video.height) == SMALL and video.rotation % 360 != 0
    np.testing.assert_array_equal(video.read_at(0.0, 0.01), plain)
    assert plain[:12, :12].mean() > 200 > 60 > plain[-12:, -12:].mean()


def test_rotated_videos_are_said_by_validation(tmp_path):
    capture = filmed(tmp_path, 30.0, 4, frames=2)
    w, h = WIDTH << 16, HEIGHT << 16
    turned(tmp_path / "film.mp4", (-0x10000, 0, 0, 0, -0x10000, 0, w, h, 1 << 30))
    write_capture_json(capture, overwrite=True)
    (warning,) = read_capture(tmp_path).warnings
    assert "turn the pictures by 180°, which is not done" in warning


# --- videos of the reference data -----------------------------------------------------------------------------------


def shared_video(shared: Path, name: str) -> VideoReader:
    path = shared / "bugs/video" / name
    if not path.is_file():
        pytest.skip(f"no video at {path}")
    return VideoReader(path)


def shown(video: VideoReader, frames: int = 24, first: float = 43.9) -> list[int | None]:
    """The maker's number of the picture at each frame of a capture at 30 a second; "end" stands as -1."""
    found: list[int | None] = []
    for frame in range(frames):
        try:
            level = level_at(video, frame)
        except BrokenVideo:
            found.append(-1)
            continue
        found.append(None if level is None else round((level - first) / 7.5))
    return found


SHARED = {
    "f15.mp4": ([n for i in range(12) for n in (i, None)], 24),
    "vfr.mp4": ([*range(6), *[None] * 6, *range(12, 24)], 24),
    "vfr.mkv": ([*range(6), *[None] * 6, *range(12, 24)], 24),
    "cut.mkv": ([*range(5), *[-1] * 19], 24),
    "trim.mp4": ([*range(7, 24), *[-1] * 7], 24),
    "rot180.mp4": ([*range(24)], 24),
    "rotsq.mp4": ([*range(24)], 24),
}


@pytest.mark.parametrize("name", SHARED)
def test_reference_videos_by_time(shared, name):
    expected, frames = SHARED[name]
    assert shown(shared_video(shared, name), frames) == expected


def test_the_reference_video_that_cannot_be_decoded_is_refused_by_its_codec(shared):
    with pytest.raises(BrokenVideo) as refused:
        shared_video(shared, "libsvtav1_yuv420p.mp4")
    assert "no picture of it can be decoded (codec 'AV01')" in refused.value.problem
    assert "H.264" in refused.value.remedy
