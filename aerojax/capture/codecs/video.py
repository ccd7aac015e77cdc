"""Pictures of a video file by their time, decoded in order by one reader that stays open."""

from __future__ import annotations

import functools
import math
import threading
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float64, UInt8

_OPEN_VIDEOS = 32
"""Readers kept open: more than the cameras of any network in use, far fewer than a process's file handles."""

_CONVERT = "convert it, for example to H.264 in MP4"


class BrokenVideo(Exception):
    """A file is no video, or one that stops too early.

    problem, remedy: what is wrong with the file, which they do not name, and what to do about it.
    """

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(problem, remedy)
        self.problem, self.remedy = problem, remedy


def is_video_container(path: Path) -> bool:
    """Whether the first bytes are those of MP4/MOV, AVI or Matroska/WebM.

    Play lists and other text that makes the decoder open further files or addresses are refused by this.
    """
    with path.open("rb") as file:
        start = file.read(12)
    riff = start[:4] == b"RIFF" and start[8:12] == b"AVI "
    return riff or start[:4] == b"\x1a\x45\xdf\xa3" or start[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free")


_STAMP_ROUNDING = 1e-3
"""Seconds that a stamp may be off: Matroska keeps whole milliseconds."""


@dataclass(frozen=True, eq=False)
class _Picture:
    time_s: float
    image: UInt8[np.ndarray, "height width 3"]


class VideoReader:
    """Pictures of a video by their time, cheap in ascending order: a step forward decodes what lies between.

    A step back starts over. Thread-safe. Pictures are those that the file stores: a rotation in its metadata is not
    applied. Times are seconds since the beginning of the stream, from the container's presentation stamps; where it has
    none, one period of its nominal rate after each other.

    width, height: of the stored pictures. fps: the container's nominal rate, 0 where it has none. rotation: degrees by
    which the metadata would turn the pictures.
    """

    def __init__(self, path: Path) -> None:
        if not is_video_container(path):
            raise BrokenVideo("is not an MP4, MOV, AVI, MKV or WebM video", "convert it")
        self.path = path
        self._lock = threading.Lock()
        self._open()
        self.width = int(self._source.get(cv2.CAP_PROP_FRAME_WIDTH))
        self.height = int(self._source.get(cv2.CAP_PROP_FRAME_HEIGHT))
        self.rotation = int(self._source.get(cv2.CAP_PROP_ORIENTATION_META))
        if self._upcoming is None:
            codec = int(self._source.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little").decode("ascii", "replace")
            raise BrokenVideo(f"no picture of it can be decoded (codec {codec!r})", _CONVERT)

    def _open(self) -> None:
        self._source = cv2.VideoCapture(str(self.path), cv2.CAP_FFMPEG)
        if not self._source.isOpened():
            raise BrokenVideo("the video cannot be decoded", _CONVERT)
        self._source.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        self.fps = float(self._source.get(cv2.CAP_PROP_FPS))
        self._asked = -math.inf
        self._latest: float | None = None  # time of the last picture that was decoded
        self._kept: _Picture | None = None
        self._advance()

    def _advance(self) -> None:
        """Decode the next picture; its time is `_upcoming`, None at the end."""
        self._upcoming: float | None = None
        if self._source.grab():
            stamp = self._source.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            if self._latest is not None and not stamp > self._latest:
                stamp = self._latest + 1 / (self.fps or 30.0)
            self._upcoming = self._latest = stamp

    def _keep(self) -> None:
        """Keep the decoded picture, and go on to the next."""
        assert self._upcoming is not None
        found, image = self._source.retrieve()
        if found:
            self._kept = _Picture(self._upcoming, cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
        self._advance()

    def read_at(self, time_s: float, within_s: float) -> UInt8[np.ndarray, "height width 3"] | None:
        """The picture nearest to a time, 8-bit sRGB; of two that are equally near the later one.

        Args:
            time_s: seconds since the beginning of the stream.
            within_s: how far the picture's time may be off.

        Returns:
            None where there is no picture so near, in a gap or before the first one.

        Raises:
            BrokenVideo: the video stops before this time.
        """
        with self._lock:
            if time_s < self._asked:
                self._open()
            self._asked = time_s
            within_s += _STAMP_ROUNDING
            while self._upcoming is not None and self._upcoming < time_s - within_s:
                self._advance()
            while self._upcoming is not None and self._is_nearer(self._upcoming, time_s, within_s):
                self._keep()
            if self._kept is not None and abs(self._kept.time_s - time_s) <= within_s:
                return self._kept.image
            if self._upcoming is None:
                last = -1.0 if self._latest is None else self._latest
                raise BrokenVideo(
                    f"stops with its picture at {last:.3f} s, before {time_s:.3f} s",
                    "lower `frames` in capture.json or replace the video",
                )
            return None

    def _is_nearer(self, time_s: float, wanted_s: float, within_s: float) -> bool:
        off = abs(time_s - wanted_s)
        kept = math.inf if self._kept is None else abs(self._kept.time_s - wanted_s)
        return off <= within_s and off <= kept + _STAMP_ROUNDING / 2

    def times(self) -> tuple[float, ...]:
        """Times of all pictures, seconds; decodes the whole video."""
        found = []
        with self._lock:
            self._open()
            while self._upcoming is not None:
                found.append(self._upcoming)
                self._advance()
            self._open()
        return tuple(found)

    def frame_count(self) -> int:
        """Number of pictures by the container's index, which may be wrong, or by counting where it has none."""
        with self._lock:
            count = int(self._source.get(cv2.CAP_PROP_FRAME_COUNT))
        return count if count > 0 else len(self.times())


def pictures_near(
    times_s: tuple[float, ...], asked_s: Float64[np.ndarray, "time"], within_s: float
) -> Bool[np.ndarray, "time"]:
    """For each time that is asked for, whether a video with pictures at these ascending times has one near enough."""
    known = np.array([-np.inf, *times_s, np.inf])
    after = np.searchsorted(known, asked_s)
    nearest = np.minimum(known[after] - asked_s, asked_s - known[after - 1])
    return nearest <= within_s + _STAMP_ROUNDING


def open_video(path: Path) -> VideoReader:
    """The reader of a video, shared between calls as long as the file does not change.

    Raises:
        BrokenVideo: the file is no video, or not one that can be decoded.
    """
    status = path.stat()
    return _open_video(path.resolve(), status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=_OPEN_VIDEOS)
def _open_video(path: Path, modified: int, size: int) -> VideoReader:
    return VideoReader(path)
