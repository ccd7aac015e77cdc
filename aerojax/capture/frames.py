"""Frames of a capture as arrays: undistorted, checked for size, and on the capture's common clock."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float32, UInt16

from aerojax.capture.codecs.mask import BrokenMask, Levels, MaskKind, decode_mask, is_soft, mask_kind, shares
from aerojax.capture.codecs.tiff import BrokenTiff, decode_tiff
from aerojax.capture.codecs.video import BrokenVideo, open_video
from aerojax.capture.format import Capture, CaptureCamera
from aerojax.capture.lenses import distort_points, undistort_image, undistort_points
from aerojax.capture.paths import is_video, locate
from aerojax.core.errors import UserError
from aerojax.core.types import FrameSet, MissingView

_LEVELS = np.arange(256, dtype=np.float32) / np.float32(255)
"""The 256 values of an 8-bit channel; looking them up is four times as fast as converting and dividing."""


CameraView = tuple[np.ndarray | None, np.ndarray | None, np.ndarray | None]
"""What one camera recorded at one instant, as in `FrameSet`: image, ids and coverage."""


def source_frame(capture: Capture, camera_index: int, frame: int) -> int | None:
    """The camera's own frame that shows the capture's time frame/fps best: round(frame - time_offset_s·fps).

    The image is off by up to half a frame period where the offset is no multiple of it.

    Returns:
        The index, or None where the camera was not recording at that time.

    Raises:
        IndexError: `frame` is not a frame of the capture.
    """
    if not 0 <= frame < capture.frames:
        raise IndexError(f"frame {frame} of a capture with {capture.frames} frames")
    index = frame + frames_early(capture, camera_index)
    return index if 0 <= index < capture.frames else None


def frames_early(capture: Capture, camera_index: int) -> int:
    """What to add to a frame of the capture's clock to have the camera's own frame that shows its time best."""
    # Halves go up: round-half-even would take one frame twice and skip the next.
    return math.floor(0.5 - capture.cameras[camera_index].time_offset_s * capture.fps)


def read_frames(capture: Capture, frame: int, *, rgb: bool = True, ids: bool = True) -> FrameSet:
    """What all cameras recorded at one frame of the capture's clock; see `read_rgb` and `read_mask`.

    A camera whose image or mask is missing or damaged, or whose video has a gap there, counts as having recorded
    nothing and is named in `missing`; where the capture says "refuse", it ends the call.

    Args:
        capture, frame: ask for frames in ascending order, because videos are decoded in order.
        rgb, ids: what to read; the other is None for every camera.

    Raises:
        UserError: a file has another size or contradicts the format; or is missing or damaged and is not to be.
    """
    views, missing = [], []
    for index in range(len(capture.cameras)):
        try:
            views.append(read_view(capture, index, frame, rgb=rgb, ids=ids))
        except UserError as error:
            if capture.missing == "refuse" or error.code not in ("missing", "unreadable"):
                raise
            views.append((None, None, None))
            missing.append(MissingView(index, str(error)))
    images, masks, coverage = zip(*views, strict=True)
    return FrameSet(frame, frame / capture.fps, images, masks, coverage, tuple(missing))


def read_view(capture: Capture, camera_index: int, frame: int, *, rgb: bool, ids: bool) -> CameraView:
    """Image, ids and coverage of one camera; arguments and errors as `read_frames`, which leaves the camera out."""
    image = read_rgb(capture, camera_index, frame) if rgb else None
    if rgb and image is None and source_frame(capture, camera_index, frame) is not None:
        camera = capture.cameras[camera_index]
        raise UserError(
            "missing",
            f"{capture.folder / camera.rgb}: has no picture within half a frame of {frame / capture.fps:.3f} s",
            "record without gaps, or correct `fps` or time_offset_s",
        )
    if not ids:
        return image, None, None
    levels = _read_levels(capture, camera_index, frame)
    if levels is None:
        return image, None, None
    camera, kind = capture.cameras[camera_index], _kind(capture, camera_index, levels)
    soft = kind == "picture" and is_soft(levels)
    return image, _ids(levels, camera, kind), _undistorted(shares(levels), camera) if soft else None


def read_rgb(capture: Capture, camera_index: int, frame: int) -> Float32[np.ndarray, "height width 3"] | None:
    """One image, sRGB 0..1, undistorted; None where the camera was not recording.

    Pixels are those that the file stores: orientation in a JPEG's tags and rotation in a video's metadata are not
    applied, because the calibration is of the sensor. Of a video it is the picture nearest to the frame's time, and
    None where that is more than half a frame away; its reader stays open: ask for frames in ascending order.

    Raises:
        UserError: the file is missing, damaged, stops too early or is of another size.
    """
    camera = capture.cameras[camera_index]
    index = source_frame(capture, camera_index, frame)
    if index is None:
        return None
    path = locate(capture.folder, camera.rgb, index, outside=capture.outside)
    if is_video(camera.rgb):
        image = _video_picture(path, frame / capture.fps - camera.time_offset_s, capture.fps)
        if image is None:
            return None
    else:
        # Orientation tags would turn the image away from its calibration; 16-bit images keep their depth.
        decoded = _decode(path, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION)
        image = cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB)
    return straight_image(image, camera, str(path))


def straight_image(image: np.ndarray, camera: CaptureCamera, source: str) -> Float32[np.ndarray, "height width 3"]:
    """A stored picture as the stages take it: sRGB 0..1, undistorted.

    Args:
        image: RGB, 8 or 16 bits.
        camera: that took it.
        source: where it comes from, for messages.

    Raises:
        UserError: it is of another size or kind.
    """
    _check_size(source, image, camera)
    if image.dtype not in (np.uint8, np.uint16):
        raise UserError("invalid", f"{source}: has {image.dtype} values", "write an 8- or 16-bit image")
    image = _undistorted(image, camera)
    if image.dtype == np.uint8:
        return cv2.LUT(image, _LEVELS)
    return image.astype(np.float32) / np.float32(65535)


def read_mask(capture: Capture, camera_index: int, frame: int) -> UInt16[np.ndarray, "height width"] | None:
    """Instance ids, 0 = background, undistorted; None without masks or where the camera was not recording.

    A picture of one object becomes 1 where it is covered by more than half; `aerojax.capture.codecs.mask` says which
    files are read and when a mask is a picture, if `mask_kind` does not.

    Raises:
        UserError: the file is missing, damaged, has colours that are no ids, or is of another size.
    """
    levels = _read_levels(capture, camera_index, frame)
    if levels is None:
        return None
    return _ids(levels, capture.cameras[camera_index], _kind(capture, camera_index, levels))


def _kind(capture: Capture, camera_index: int, levels: Levels) -> MaskKind | None:
    return capture.cameras[camera_index].mask_kind or capture.mask_kind or mask_kind(levels)


def _read_levels(capture: Capture, camera_index: int, frame: int) -> Levels | None:
    path = _path(capture, camera_index, frame, "mask")
    if path is None:
        return None
    try:
        levels = decode_mask(path.read_bytes())
    except OSError:
        raise UserError("unreadable", f"{path}: cannot be read", "check the permissions") from None
    except BrokenMask as broken:
        code = "unreadable" if broken.damaged else "invalid"
        raise UserError(code, f"{path}: {broken.problem}", broken.remedy) from None
    _check_size(path, levels, capture.cameras[camera_index])
    return levels


def _ids(levels: Levels, camera: CaptureCamera, kind: MaskKind | None) -> UInt16[np.ndarray, "height width"]:
    if kind != "picture":
        return _undistorted(levels.astype(np.uint16), camera, blend=False)
    if is_soft(levels):
        return (_undistorted(shares(levels), camera) > 0.5).astype(np.uint16)
    return _undistorted((shares(levels) > 0.5).astype(np.uint16), camera, blend=False)


def read_depth(capture: Capture, camera_index: int, frame: int) -> Float32[np.ndarray, "height width"] | None:
    """Depth along the optical axis, metres, 0 = none, undistorted; None as for `read_mask`.

    Raises:
        UserError: the file is missing, damaged, not float32, of another size, or holds a negative or infinite value.
    """
    path = _path(capture, camera_index, frame, "depth")
    if path is None:
        return None
    camera = capture.cameras[camera_index]
    depth = _decode(path, cv2.IMREAD_UNCHANGED)
    if depth.ndim != 2 or depth.dtype != np.float32:
        raise UserError("unreadable", f"{path}: depth must be one channel of float32", "write metres as a float TIFF")
    _check_size(path, depth, camera)
    if not np.all(np.isfinite(depth) & (depth >= 0)):
        raise UserError("unreadable", f"{path}: depth must be finite and not negative", "write 0 where there is none")
    return _undistorted(depth, camera, blend=False)


def read_coverage(capture: Capture, camera_index: int, frame: int) -> Float32[np.ndarray, "height width"] | None:
    """Share of each pixel that the objects cover, 0..1, undistorted; None as for `read_mask`.

    Raises:
        UserError: the file is missing, damaged, not grey with 8 bits, or of another size.
    """
    path = _path(capture, camera_index, frame, "coverage")
    if path is None:
        return None
    camera = capture.cameras[camera_index]
    coverage = _decode(path, cv2.IMREAD_UNCHANGED)
    if coverage.ndim != 2 or coverage.dtype != np.uint8:
        raise UserError(
            "unreadable", f"{path}: coverage must be a grey 8-bit image", "write 255 where a pixel is covered whole"
        )
    _check_size(path, coverage, camera)
    return cv2.LUT(_undistorted(coverage, camera), _LEVELS)


def read_normal(capture: Capture, camera_index: int, frame: int) -> Float32[np.ndarray, "height width 3"] | None:
    """Unit normals of the surfaces in the world frame, 0 where there is none, undistorted; None as for `read_mask`.

    Raises:
        UserError: the file is missing, damaged, not RGB with 16 bits, or of another size.
    """
    path = _path(capture, camera_index, frame, "normal")
    if path is None:
        return None
    camera = capture.cameras[camera_index]
    stored = _decode(path, cv2.IMREAD_UNCHANGED)
    if stored.ndim != 3 or stored.shape[2] != 3 or stored.dtype != np.uint16:
        raise UserError("unreadable", f"{path}: normals must be a 16-bit RGB image", "write (n + 1)/2·65535")
    _check_size(path, stored, camera)
    stored = _undistorted(stored[..., ::-1], camera, blend=False)  # OpenCV decodes to blue, green, red
    normal = np.zeros(stored.shape, np.float32)
    some = stored.any(axis=2)
    directions = stored[some].astype(np.float32) * np.float32(2 / 65535) - 1
    normal[some] = directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), np.float32(1e-9))
    return normal


def read_flow(capture: Capture, camera_index: int, frame: int) -> Float32[np.ndarray, "height width 2"] | None:
    """Where each pixel moves until the next frame, pixels right and down, undistorted; None as for `read_mask`.

    Both ends of a lens-distorted image's vectors are undistorted.

    Raises:
        UserError: the file is missing, damaged, not float32 with two channels, of another size, or not finite.
    """
    path = _path(capture, camera_index, frame, "flow")
    if path is None:
        return None
    camera = capture.cameras[camera_index]
    try:
        flow = decode_tiff(path.read_bytes())
    except OSError:
        raise UserError("unreadable", f"{path}: cannot be read", "check the permissions") from None
    except BrokenTiff as error:
        raise UserError("unreadable", f"{path}: the image {error}", "write or copy it again") from None
    if flow.shape[2] != 2:
        raise UserError(
            "mismatch", f"{path}: flow must have two channels, has {flow.shape[2]}", "write pixels right and down"
        )
    _check_size(path, flow, camera)
    if not np.isfinite(flow).all():
        raise UserError("unreadable", f"{path}: flow must be finite", "write 0 where nothing moves")
    return flow if camera.distortion_model == "none" else _undistorted_flow(flow, camera)


def _undistorted_flow(flow: np.ndarray, camera: CaptureCamera) -> np.ndarray:
    flow = _undistorted(flow, camera, blend=False)
    rows, columns = np.nonzero(flow.any(axis=2))
    starts = np.stack([columns, rows], axis=1) + 0.5
    lens = camera.K, camera.distortion_model, camera.distortion
    ends = distort_points(starts, *lens) + flow[rows, columns]
    flow[rows, columns] = undistort_points(ends, *lens) - starts
    return flow


def _path(capture: Capture, camera_index: int, frame: int, kind: str) -> Path | None:
    """The file of one kind of image; None without a pattern or where the camera was not recording."""
    index = source_frame(capture, camera_index, frame)
    pattern = getattr(capture.cameras[camera_index], kind)
    return None if index is None or pattern is None else locate(capture.folder, pattern, index, outside=capture.outside)


def _video_picture(path: Path, time_s: float, fps: float) -> np.ndarray | None:
    try:
        return open_video(path).read_at(time_s, 0.5 / fps)
    except BrokenVideo as broken:
        raise UserError("unreadable", f"{path}: {broken.problem}", broken.remedy) from None


def _decode(path: Path, flags: int) -> np.ndarray:
    try:
        data = np.fromfile(path, dtype=np.uint8)  # decoding from memory also works for paths beyond ASCII
        image = cv2.imdecode(data, flags) if data.size else None
    except (cv2.error, OSError):
        image = None
    if image is None:
        raise UserError("unreadable", f"{path}: the image is damaged or cut short", "write or copy it again")
    return image


def _check_size(path: Path | str, image: np.ndarray, camera: CaptureCamera) -> None:
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        wanted = f"{camera.width}×{camera.height}"
        raise UserError(
            "mismatch", f"{path}: is {width}×{height} pixels, camera {camera.name} {wanted}", "correct capture.json"
        )


def _undistorted(image: np.ndarray, camera: CaptureCamera, *, blend: bool = True) -> np.ndarray:
    return undistort_image(image, camera.K, camera.distortion_model, camera.distortion, blend=blend)
