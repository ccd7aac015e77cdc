"""Frames of a capture to disk: PNG colour, 16-bit PNG instance ids, float32 TIFF depth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8, UInt16

from aerojax.capture.format import CaptureCamera
from aerojax.capture.paths import frame_path, is_video, relative_path_problem
from aerojax.errors import UserError

_PNG_LEVEL = [cv2.IMWRITE_PNG_COMPRESSION, 3]  # twice the speed of the default for a tenth more bytes


def write_frame(
    folder: Path,
    camera: CaptureCamera,
    frame: int,
    rgb: UInt8[np.ndarray, "height width 3"] | Float[np.ndarray, "height width 3"],
    mask: UInt16[np.ndarray, "height width"] | None = None,
    depth: Float32[np.ndarray, "height width"] | None = None,
) -> None:
    """Write one frame of one camera where its patterns say; folders are made.

    Args:
        folder: the capture's folder; write `capture.json` last, with `write_capture_json`.
        camera: gives patterns and size; a mask or depth pattern needs its array and the other way round.
        frame: index of the file.
        rgb: sRGB, 8-bit or 0..1 (rounded, clipped).
        mask: instance ids, 0 = background.
        depth: metres along the optical axis, 0 = none.

    Raises:
        UserError: sizes differ from the camera's, a pattern has no array, or the pattern leaves the folder.
    """
    if is_video(camera.rgb):
        raise UserError(
            f"camera {camera.name}: rgb is the video {camera.rgb}; frames are written to a {{frame}} pattern"
        )
    colour = rgb if rgb.dtype == np.uint8 else np.round(np.clip(rgb, 0.0, 1.0) * 255.0).astype(np.uint8)
    _write(folder, camera, "rgb", camera.rgb, frame, cv2.cvtColor(np.ascontiguousarray(colour), cv2.COLOR_RGB2BGR))
    _write(folder, camera, "mask", camera.mask, frame, mask)
    _write(folder, camera, "depth", camera.depth, frame, depth)


def _write(
    folder: Path, camera: CaptureCamera, kind: str, pattern: str | None, frame: int, image: np.ndarray | None
) -> None:
    if pattern is None and image is None:
        return
    if pattern is None or image is None:
        given, absent = ("array", "pattern") if pattern is None else ("pattern", "array")
        raise UserError(f"camera {camera.name}: a {kind} {given} without a {kind} {absent}; give both or none")
    if image.shape[:2] != (camera.height, camera.width):
        size = f"{image.shape[1]}×{image.shape[0]}"
        raise UserError(f"camera {camera.name}: {kind} is {size}, the camera {camera.width}×{camera.height}")
    relative = frame_path(pattern, frame)
    if problem := relative_path_problem(relative):
        raise UserError(f"camera {camera.name}: {kind} path {relative!r} {problem}; use a relative path")
    path = folder / relative
    path.parent.mkdir(parents=True, exist_ok=True)
    options = _PNG_LEVEL if path.suffix.lower() == ".png" else []
    path.write_bytes(cv2.imencode(path.suffix, image, options)[1].tobytes())
