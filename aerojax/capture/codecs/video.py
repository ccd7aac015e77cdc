"""Frames of a video file, decoded in order by one reader that stays open."""

from __future__ import annotations

import functools
import threading
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

_OPEN_VIDEOS = 32
"""Readers kept open: more than the cameras of any network in use, far fewer than a process's file handles."""


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


class VideoReader:
    """Random access to a video that is cheap in order: reading frame i+1 after i decodes one frame.

    A step forward decodes and drops what lies between; a step back starts over. Thread-safe.
    """

    def __init__(self, path: Path) -> None:
        if not is_video_container(path):
            raise BrokenVideo("is not an MP4, MOV, AVI, MKV or WebM video", "convert it")
        self.path = path
        self._lock = threading.Lock()
        self._open()
        self.width = int(self._source.get(cv2.CAP_PROP_FRAME_WIDTH))
        self.height = int(self._source.get(cv2.CAP_PROP_FRAME_HEIGHT))

    def _open(self) -> None:
        self._source = cv2.VideoCapture(str(self.path), cv2.CAP_FFMPEG)
        self._next = 0
        if not self._source.isOpened():
            raise BrokenVideo("the video cannot be decoded", "convert it, for example to H.264 in MP4")

    def frame_count(self) -> int:
        """Number of frames by the container's index, or by counting where it has none."""
        with self._lock:
            count = int(self._source.get(cv2.CAP_PROP_FRAME_COUNT))
            if count <= 0:
                self._open()
                count = 0
                while self._source.grab():
                    count += 1
                self._open()
            return count

    def read(self, frame: int) -> UInt8[np.ndarray, "height width 3"]:
        """One frame as 8-bit sRGB.

        Raises:
            BrokenVideo: the video stops before this frame or is damaged there.
        """
        with self._lock:
            if frame < self._next:
                self._open()
            while self._next < frame:
                if not self._source.grab():
                    raise _ended(frame)
                self._next += 1
            found, image = self._source.read()
            if not found:
                raise _ended(frame)
            self._next += 1
            return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def _ended(frame: int) -> BrokenVideo:
    return BrokenVideo(f"stops before frame {frame}", "lower `frames` in capture.json or replace the video")


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
