"""Overlay videos of a clip: every camera with outline, box, track and label, and all of them in one mosaic."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.capture.frames import read_frames
from aerojax.capture.paths import distinct_names
from aerojax.core.errors import UserError
from aerojax.core.files import whole_file
from aerojax.geometry.cameras import points_in_camera, project_points
from aerojax.pipeline.exports.images import Sighting, sightings
from aerojax.pipeline.offline import Clip
from aerojax.pipeline.track_points import TrackPoint

MOSAIC_WIDTH = 1920
"""Pixels that a mosaic is at most wide."""
_OUTLINE, _BOX, _TRACK = (0, 200, 255), (60, 220, 60), (255, 120, 30)  # BGR
_TEXT, _PLATE = (255, 255, 255), (40, 40, 40)
_Picture = UInt8[np.ndarray, "height width 3"]


def export_videos(
    capture: Capture,
    clip: Clip,
    points: Sequence[TrackPoint],
    folder: Path,
    *,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Path:
    """Write `<camera>.mp4` (undistorted images) and `mosaic.mp4`, every frame of the capture in each.

    Args:
        capture: what was classified.
        clip: of it, with its observations.
        points: its track.
        folder: where they go.
        progress: called after each frame with (done, total, what).

    Raises:
        UserError: OpenCV has no encoder for MP4 here, or an image has another size than the camera.
    """
    seen: dict[int, dict[int, Sighting]] = {}
    for one in sightings(capture, clip, stored=False):
        seen.setdefault(one.frame, {})[one.camera] = one
    by_frame = {point.frame: point for point in points}
    names = distinct_names([camera.name for camera in capture.cameras])
    tile = _tile(capture.cameras)
    columns = math.ceil(math.sqrt(len(names)))
    rows = math.ceil(len(names) / columns)
    sizes = [(camera.width, camera.height) for camera in capture.cameras] + [(columns * tile[0], rows * tile[1])]
    with contextlib.ExitStack() as stack:
        writers = [
            stack.enter_context(_writer(folder / f"{name}.mp4", capture.fps, size))
            for name, size in zip([*names, "mosaic"], sizes, strict=True)
        ]
        latest: TrackPoint | None = None
        for frame in range(capture.frames):
            latest = by_frame.get(frame, latest)
            images = read_frames(capture, frame, ids=False).rgb
            drawn = []
            for index, camera in enumerate(capture.cameras):
                picture = _picture(images[index], camera)
                trail = [point.position for point in points if point.frame <= frame]
                _draw(picture, camera, seen.get(frame, {}).get(index), trail, latest, frame)
                drawn.append(picture)
            for writer, picture in zip(writers, [*drawn, _mosaic(drawn, tile, columns, rows)], strict=True):
                writer.write(picture)
            progress(frame + 1, capture.frames, "videos")
    return folder


@contextlib.contextmanager
def _writer(path: Path, fps: float, size: tuple[int, int]) -> Iterator[_Cropping]:
    """A video that appears when it is whole; odd sides lose a pixel, which the codec does not know."""
    even = size[0] - size[0] % 2, size[1] - size[1] % 2
    with whole_file(path) as temporary:
        writer = cv2.VideoWriter(str(temporary), cv2.VideoWriter.fourcc(*"mp4v"), fps, even)
        if not writer.isOpened():
            raise UserError("unavailable", f"{path}: this OpenCV cannot write MP4", "leave video out of export=")
        try:
            yield _Cropping(writer, even)
        finally:
            writer.release()


class _Cropping:
    """A writer of pictures that may be a pixel too large."""

    def __init__(self, writer: cv2.VideoWriter, size: tuple[int, int]) -> None:
        self.writer, self.size = writer, size

    def write(self, picture: _Picture) -> None:
        self.writer.write(np.ascontiguousarray(picture[: self.size[1], : self.size[0]]))


def _tile(cameras: Sequence[CaptureCamera]) -> tuple[int, int]:
    """Width and height of one camera in the mosaic, even, all as wide as the first is in shape."""
    columns = math.ceil(math.sqrt(len(cameras)))
    width = min(MOSAIC_WIDTH // columns, cameras[0].width)
    height = round(width * cameras[0].height / cameras[0].width)
    return width - width % 2, height - height % 2


def _picture(image: np.ndarray | None, camera: CaptureCamera) -> _Picture:
    if image is None:
        return np.zeros((camera.height, camera.width, 3), np.uint8)
    return cv2.cvtColor(np.round(image * 255).astype(np.uint8), cv2.COLOR_RGB2BGR)


def _draw(
    picture: _Picture,
    camera: CaptureCamera,
    sighting: Sighting | None,
    trail: Sequence[tuple[float, float, float]],
    point: TrackPoint | None,
    frame: int,
) -> None:
    thick = max(1, round(picture.shape[1] / 960))
    ahead = np.array([p for p in trail if points_in_camera(np.array(p), camera)[2] > 0], np.float64).reshape(-1, 3)
    if len(ahead):
        pixels = np.clip(project_points(ahead, camera) - 0.5, -1e5, 1e5)
        cv2.polylines(picture, [np.round(pixels).astype(np.int32)[:, None]], False, _TRACK, thick, cv2.LINE_AA)
    if sighting is not None:
        mask = sighting.mask.astype(np.uint8)
        outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(picture, outlines, -1, _OUTLINE, thick)
        x0, y0, x1, y1 = (round(side) for side in sighting.box)
        margin = 4 * thick
        cv2.rectangle(picture, (x0 - margin, y0 - margin), (x1 + margin, y1 + margin), _BOX, thick)
        if point is not None:
            text = f"{point.label} {point.probabilities[point.label]:.2f}"
            _write(picture, text, (x0 - margin, y0 - 2 * margin), _BOX)
    state = "" if sighting is not None else " (not used)"
    _write(picture, f"{_ascii(camera.name)}  frame {frame}{state}", (8 * thick, 22 * thick), _TEXT)


def _write(picture: _Picture, text: str, corner: tuple[int, int], colour: tuple[int, int, int]) -> None:
    """Text on a dark plate, within the picture; corner: left end of its base line."""
    scale = 0.5 * max(1.0, picture.shape[1] / 960)
    thick = max(1, round(scale))
    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, thick)
    x = min(max(corner[0], 3), max(3, picture.shape[1] - width - 3))
    y = min(max(corner[1], height + 3), picture.shape[0] - below - 3)
    cv2.rectangle(picture, (x - 3, y - height - 3), (x + width + 3, y + below), _PLATE, cv2.FILLED)
    cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, scale, colour, thick, cv2.LINE_AA)


def _ascii(text: str) -> str:
    """What OpenCV's font has letters for."""
    return text.encode("ascii", "replace").decode()


def _mosaic(
    pictures: Sequence[np.ndarray], tile: tuple[int, int], columns: int, rows: int
) -> UInt8[np.ndarray, "height width 3"]:
    """Pictures in rows, each in its shape within its tile."""
    canvas = np.zeros((rows * tile[1], columns * tile[0], 3), np.uint8)
    for index, picture in enumerate(pictures):
        scale = min(tile[0] / picture.shape[1], tile[1] / picture.shape[0])
        size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        y, x = (index // columns) * tile[1], (index % columns) * tile[0]
        canvas[y : y + size[1], x : x + size[0]] = small
    return canvas
