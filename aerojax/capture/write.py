"""Frames of a capture to disk: PNG colour, ids, coverage and normals, float32 TIFF depth and flow."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8, UInt16

from aerojax.capture.format import CaptureCamera
from aerojax.capture.paths import frame_path, is_video, relative_path_problem
from aerojax.capture.tiff import encode_tiff
from aerojax.errors import UserError

_PNG_LEVEL = [cv2.IMWRITE_PNG_COMPRESSION, 3]  # twice the speed of the default for a tenth more bytes


@dataclass(frozen=True)
class FrameExtras:
    """Optional images beside colour, mask and depth.

    coverage: 255 = the pixel is covered whole. normal: unit, world frame, 0 = none. flow: pixels right and down.
    """

    coverage: UInt8[np.ndarray, "height width"] | None = None
    normal: Float[np.ndarray, "height width 3"] | None = None
    flow: Float32[np.ndarray, "height width 2"] | None = None


def write_frame(
    folder: Path,
    camera: CaptureCamera,
    frame: int,
    rgb: UInt8[np.ndarray, "height width 3"] | Float[np.ndarray, "height width 3"],
    mask: UInt16[np.ndarray, "height width"] | None = None,
    depth: Float32[np.ndarray, "height width"] | None = None,
    *,
    extra: FrameExtras | None = None,
) -> None:
    """Write one frame of one camera where its patterns say; folders are made.

    Args:
        folder: the capture's folder; write `capture.json` last, with `write_capture_json`.
        camera: gives patterns and size; a mask or depth pattern needs its array and the other way round.
        frame: index of the file.
        rgb: sRGB, 8-bit or 0..1 (rounded, clipped).
        mask: instance ids, 0 = background.
        depth: metres along the optical axis, 0 = none.
        extra: coverage, normals and flow, each where the camera has a pattern for it.

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
    extra = extra or FrameExtras()
    _write(folder, camera, "coverage", camera.coverage, frame, extra.coverage)
    normal = None if extra.normal is None else encode_normal(extra.normal)[..., ::-1]
    _write(folder, camera, "normal", camera.normal, frame, normal)
    _write(folder, camera, "flow", camera.flow, frame, extra.flow)


def encode_normal(normal: Float[np.ndarray, "*shape 3"]) -> UInt16[np.ndarray, "*shape 3"]:
    """Unit normals as they are stored, (n + 1)/2·65535; 0, 0, 0 where there is none."""
    stored = np.round((np.clip(normal, -1.0, 1.0) + 1) * 32767.5).astype(np.uint16)
    return np.where(normal.any(axis=-1, keepdims=True), stored, np.uint16(0))


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
    path.write_bytes(_encoded(image, path.suffix.lower()))


def _encoded(image: np.ndarray, suffix: str) -> bytes:
    if image.dtype == np.float32:
        channels = image if image.ndim == 3 else image[..., None]
        return encode_tiff(channels, (0, 0), (image.shape[1], image.shape[0]))
    options = _PNG_LEVEL if suffix == ".png" else []
    return cv2.imencode(suffix, np.ascontiguousarray(image), options)[1].tobytes()
