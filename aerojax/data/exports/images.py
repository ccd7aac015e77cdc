"""Images of a capture in an export: placed as they are where a format can take them, written anew where not."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8, UInt16

from aerojax.capture.codecs.headers import BrokenImage, read_header
from aerojax.capture.codecs.orientation import has_orientation, without_orientation
from aerojax.capture.codecs.png import encode_png
from aerojax.capture.codecs.video import open_video, pictures_near
from aerojax.capture.format import Capture
from aerojax.capture.frames import read_mask, read_rgb, source_frame
from aerojax.capture.paths import RGB_SUFFIXES, frame_path, is_video, locate
from aerojax.core.errors import UserError
from aerojax.core.files import write_bytes
from aerojax.data.exports.sources import Placement
from aerojax.geometry.boxes import tight_box

_PNG_LEVEL = [cv2.IMWRITE_PNG_COMPRESSION, 3]  # twice the speed of the default for a tenth more bytes


def recorded_frames(capture: Capture, camera_index: int) -> list[int]:
    """The capture's frames that this camera has an image of (all of them without an offset of its clock).

    Frames whose image or mask is missing or cut short, and gaps of a video, are left out unless the capture refuses
    them.
    """
    frames = [frame for frame in range(capture.frames) if source_frame(capture, camera_index, frame) is not None]
    if capture.missing == "refuse":
        return frames
    camera = capture.cameras[camera_index]
    if is_video(camera.rgb):
        times = open_video(locate(capture.folder, camera.rgb, 0, outside=capture.outside)).times()
        asked = np.array(frames, np.float64) / capture.fps - camera.time_offset_s
        there = pictures_near(times, asked, 0.5 / capture.fps)
        frames = [frame for frame, found in zip(frames, there.tolist(), strict=True) if found]
    patterns = [p for p in (camera.rgb, camera.mask) if p is not None and not is_video(p)]
    return [frame for frame in frames if all(_is_whole(capture, camera_index, p, frame) for p in patterns)]


def _is_whole(capture: Capture, camera_index: int, pattern: str, frame: int) -> bool:
    index = source_frame(capture, camera_index, frame)
    assert index is not None
    path = capture.folder / frame_path(pattern, index)
    try:
        read_header(path)
    except BrokenImage:
        return False
    return True


def place_image(
    capture: Capture,
    camera_index: int,
    frame: int,
    target: Path,
    how: Placement,
    *,
    suffixes: tuple[str, ...] = RGB_SUFFIXES,
) -> Path:
    """Bring one colour image into an export, undistorted.

    Args:
        capture, camera_index, frame: which image.
        target: where, without suffix; folders are made.
        how: copy or link; an image of a lens, of a video or of another suffix is written anew as PNG, and one with an
            orientation tag is copied without it: boxes and calibration are of the stored pixels.
        suffixes: lower-case endings that the format can take.

    Returns:
        `target` with the suffix of the image.

    Raises:
        UserError: the image cannot be read or linked.
    """
    camera = capture.cameras[camera_index]
    index = source_frame(capture, camera_index, frame)
    assert index is not None, "callers ask for recorded frames"
    target.parent.mkdir(parents=True, exist_ok=True)
    if not is_video(camera.rgb) and camera.distortion_model == "none":
        source = locate(capture.folder, camera.rgb, index, outside=capture.outside)
        if source.suffix.lower() in suffixes:
            path = target.with_name(target.name + source.suffix.lower())
            if has_orientation(source):
                write_bytes(path, without_orientation(source))
            else:
                _place(source.resolve(), path, how)
            return path
    path = target.with_name(target.name + ".png")
    rgb = read_rgb(capture, camera_index, frame)
    assert rgb is not None
    pixels = cv2.cvtColor(np.round(rgb * 255.0).astype(np.uint8), cv2.COLOR_RGB2BGR)
    write_bytes(path, cv2.imencode(".png", pixels, _PNG_LEVEL)[1].tobytes())
    return path


def _place(source: Path, path: Path, how: Placement) -> None:
    try:
        if how == "copy":
            shutil.copyfile(source, path)
        elif how == "hardlink":
            os.link(source, path)
        else:  # relative, so that data set and export can move together
            path.symlink_to(os.path.relpath(source, path.parent.resolve()))
    except OSError as error:
        remedy = "free space there" if how == "copy" else "use images=copy"
        raise UserError("unwritable", f"{path}: cannot {how} {source}: {error.strerror}", remedy) from None


def place_mask(capture: Capture, camera_index: int, frame: int, path: Path) -> bool:
    """Write an 8-bit image of all objects (255) before the background (0); False where the capture has no masks."""
    mask = read_mask(capture, camera_index, frame)
    if mask is None:
        return False
    write_sparse_png(path, np.where(mask > 0, np.uint8(255), np.uint8(0)))
    return True


def write_sparse_png(path: Path, image: UInt8[np.ndarray, "*shape"] | UInt16[np.ndarray, "*shape"]) -> None:
    """Write a grey or RGB image that is mostly 0, in time that goes with the rest of it; folders are made."""
    channels = image if image.ndim == 3 else image[..., None]
    height, width, count = channels.shape
    box = tight_box(np.any(channels, axis=-1)) or (0.0, 0.0, 0.0, 0.0)
    x0, y0, x1, y1 = (int(side) for side in box)
    write_bytes(path, encode_png(channels[y0:y1, x0:x1], (x0, y0), (width, height), (0,) * count))
