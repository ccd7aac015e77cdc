"""Frames of a capture to disk: PNG colour, ids, coverage and normals, float32 TIFF depth and flow."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8, UInt16

from aerojax.capture.codecs.png import encode_png
from aerojax.capture.codecs.tiff import encode_tiff
from aerojax.capture.format import CaptureCamera
from aerojax.capture.paths import frame_path, is_video, relative_path_problem
from aerojax.core.errors import UserError


@dataclass(frozen=True)
class FrameExtras:
    """Optional images beside colour, mask and depth.

    coverage: 255 = the pixel is covered whole. normal: unit, world frame, 0 = none. flow: pixels right and down.
    """

    coverage: UInt8[np.ndarray, "rows columns"] | None = None
    normal: Float[np.ndarray, "rows columns 3"] | None = None
    flow: Float32[np.ndarray, "rows columns 2"] | None = None


@dataclass(frozen=True)
class Placement:
    """Where the arrays of a frame stand in its image: all the rest shows nothing but the background.

    corner: column and row of their first pixel.
    background: 8-bit sRGB around them; masks, depths and the like are 0 there.
    """

    corner: tuple[int, int]
    background: tuple[int, int, int]


def write_frame(
    folder: Path,
    camera: CaptureCamera,
    frame: int,
    rgb: UInt8[np.ndarray, "height width 3"] | Float[np.ndarray, "height width 3"],
    mask: UInt16[np.ndarray, "rows columns"] | None = None,
    depth: Float32[np.ndarray, "rows columns"] | None = None,
    *,
    extra: FrameExtras | None = None,
    placement: Placement | None = None,
) -> None:
    """Write one frame of one camera where its patterns say; folders are made.

    Args:
        folder: the capture's folder; write `capture.json` last, with `write_capture_json`.
        camera: gives patterns and size; every pattern needs its array and the other way round.
        frame: index of the file.
        rgb: sRGB, 8-bit or 0..1 (rounded, clipped).
        mask: instance ids, 0 = background.
        depth: metres along the optical axis, 0 = none.
        extra: coverage, normals and flow.
        placement: the arrays are a window of the image, and the time taken goes with the window; None: the whole image.
            An array of the image's size stays a whole image all the same.

    Raises:
        UserError: sizes differ from the camera's, a pattern has no array, or the pattern leaves the folder.
    """
    if is_video(camera.rgb):
        raise UserError(
            "invalid", f"camera {camera.name}: rgb is the video {camera.rgb}", "frames are written to a {frame} pattern"
        )
    extra = extra or FrameExtras()
    images = {
        "rgb": rgb if rgb.dtype == np.uint8 else np.round(np.clip(rgb, 0.0, 1.0) * 255.0).astype(np.uint8),
        "mask": mask,
        "depth": depth,
        "coverage": extra.coverage,
        "normal": None if extra.normal is None else encode_normal(extra.normal),
        "flow": extra.flow,
    }
    for kind, image in images.items():
        _write(folder, camera, kind, frame, image, placement)


def encode_normal(normal: Float[np.ndarray, "*shape 3"]) -> UInt16[np.ndarray, "*shape 3"]:
    """Unit normals as they are stored, (n + 1)/2·65535; 0, 0, 0 where there is none."""
    stored = np.round((np.clip(normal, -1.0, 1.0) + 1) * 32767.5).astype(np.uint16)
    return np.where(normal.any(axis=-1, keepdims=True), stored, np.uint16(0))


def _write(
    folder: Path, camera: CaptureCamera, kind: str, frame: int, image: np.ndarray | None, placement: Placement | None
) -> None:
    pattern = getattr(camera, kind)
    if pattern is None and image is None:
        return
    if pattern is None or image is None:
        given, absent = ("array", "pattern") if pattern is None else ("pattern", "array")
        raise UserError(
            "invalid", f"camera {camera.name}: a {kind} {given} without a {kind} {absent}", "give both or none"
        )
    _check_place(camera, kind, image, placement)
    relative = frame_path(pattern, frame)
    if problem := relative_path_problem(relative):
        raise UserError("invalid", f"camera {camera.name}: {kind} path {relative!r} {problem}", "use a relative path")
    path = folder / relative
    path.parent.mkdir(parents=True, exist_ok=True)
    size = camera.width, camera.height
    if placement is None or image.shape[1::-1] == size:
        placement = Placement((0, 0), (0, 0, 0))
    background = placement.background if kind == "rgb" else (0, 0, 0) if kind == "normal" else (0,)
    path.write_bytes(_encoded(image, placement.corner, size, background, path.suffix.lower()))


def _check_place(camera: CaptureCamera, kind: str, image: np.ndarray, placement: Placement | None) -> None:
    height, width = image.shape[:2]
    if placement is None and (width, height) != (camera.width, camera.height):
        wanted = f"{camera.width}×{camera.height}"
        raise UserError(
            "invalid", f"camera {camera.name}: {kind} is {width}×{height}, the camera {wanted}", "resize it"
        )
    whole = placement is None or (width, height) == (camera.width, camera.height)
    x, y = (0, 0) if whole else placement.corner
    if min(x, y) < 0 or x + width > camera.width or y + height > camera.height:
        raise UserError(
            "invalid", f"camera {camera.name}: a window of {kind} at {(x, y)} reaches beyond the image", "clip it"
        )


def _encoded(
    image: np.ndarray, corner: tuple[int, int], size: tuple[int, int], background: tuple[int, ...], suffix: str
) -> bytes:
    channels = image if image.ndim == 3 else image[..., None]
    if image.dtype == np.float32:
        return encode_tiff(channels, corner, size)
    if suffix == ".png":
        return encode_png(channels, corner, size, background)
    whole = np.empty((size[1], size[0], channels.shape[2]), image.dtype)
    whole[:] = np.array(background, image.dtype)
    whole[corner[1] : corner[1] + image.shape[0], corner[0] : corner[0] + image.shape[1]] = channels
    return cv2.imencode(suffix, np.ascontiguousarray(whole[..., ::-1]))[1].tobytes()
