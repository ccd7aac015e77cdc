"""A capture on disk: `capture.json`, one folder of frames (or one video) a camera, and optionally `truth.json`."""

from __future__ import annotations

import dataclasses
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from aerojax.capture.codecs.mask import MaskKind
from aerojax.capture.truth import (
    JointPose,
    ObjectState,
    TrackedObject,
    Truth,
    rotate_truth,
    truth_from_json,
    truth_to_json,
)
from aerojax.capture.validate.examination import (
    EXACT_ROTATION,
    FORMAT,
    OPTIONAL_IMAGES,
    VERSION,
    Examination,
    examine,
    examine_network,
)
from aerojax.capture.validate.findings import refuse
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.core.types import Camera
from aerojax.geometry.geodesy import GeographicOrigin

__all__ = [
    "CalibratedCamera",
    "Capture",
    "CaptureCamera",
    "JointPose",
    "ObjectState",
    "TrackedObject",
    "Truth",
    "read_capture",
    "read_network",
    "rotate_world",
    "write_capture_json",
]


@dataclass(frozen=True, eq=False)
class CalibratedCamera:
    """How a camera sees and where it stands.

    K: pixels; the centre of the top-left pixel is (0.5, 0.5).
    distortion_model: "none", "opencv" or "opencv_fisheye"; images are undistorted on reading and keep K.
    world_from_cam: rigid transform, metres, OpenCV axes.
    """

    name: str
    width: int
    height: int
    K: Float64[np.ndarray, "3 3"]
    distortion_model: str
    distortion: tuple[float, ...]
    world_from_cam: Float64[np.ndarray, "4 4"]


@dataclass(frozen=True, eq=False)
class CaptureCamera(CalibratedCamera):
    """One calibrated camera of a capture and the patterns of its files (relative, `{frame}` or `{frame:0Nd}`).

    rgb: file pattern or one video file. mask, depth: file patterns or None.
    time_offset_s: how late the camera's clock is; what it took as frame j shows time j/fps + offset.
    coverage: pattern of 8-bit images, the share of each pixel that objects cover (255 = all of it), or None.
    normal: pattern of 16-bit RGB images, world normals n as (n + 1)/2·65535 and 0 where there is none, or None.
    flow: pattern of two-channel float32 images, pixels right and down to the next frame, or None.
    mask_kind: what the masks hold, "ids" of instances or "picture" of one object; None leaves it to the capture.
    """

    rgb: str
    mask: str | None
    depth: str | None
    time_offset_s: float
    coverage: str | None = None
    normal: str | None = None
    flow: str | None = None
    mask_kind: MaskKind | None = None

    def pinhole(self) -> Camera:
        """The camera that took the undistorted images, as float32 arrays for JAX."""
        transform = jnp.asarray(self.world_from_cam, jnp.float32)
        return Camera(jnp.asarray(self.K, jnp.float32), transform, width=self.width, height=self.height)


@dataclass(frozen=True, eq=False)
class Capture:
    """A network of cameras that watched for `frames` frames at `fps` frames per second.

    missing: what to do with files that are missing or damaged: "drop" the camera from that frame, or "refuse" them.
    warnings: what its user should know, one sentence each.
    mask_kind: what the masks hold of cameras that do not say it, by how they look (`aerojax.capture.codecs.mask` has
        the rule); None judges image by image.
    origin: where the world's origin lies on the earth; its axes are then +X east, +Y north, +Z up.
    outside: whether files may lie outside of `folder`, by absolute paths or links.
    """

    folder: Path
    fps: float
    frames: int
    cameras: tuple[CaptureCamera, ...]
    truth: Truth | None
    missing: Literal["drop", "refuse"] = "drop"
    warnings: tuple[str, ...] = ()
    mask_kind: MaskKind | None = None
    origin: GeographicOrigin | None = None
    outside: bool = False

    def true_class(self, object_id: int | None) -> str | None:
        """The class that the truth gives this object, or all objects where it is None, if it gives one."""
        objects = self.truth.objects if self.truth else ()
        named = {o.class_name for o in objects if object_id is None or o.object_id == object_id}
        return named.pop() if len(named) == 1 else None


def read_capture(folder: Path) -> Capture:
    """Validate a capture and read everything but its images.

    Raises:
        UserError: lists every problem at once, each with file, field and remedy.
    """
    examined = examine(folder)
    refuse(examined.problems, f"capture {folder}")
    raw = examined.capture
    assert raw is not None  # the validator returns it whenever there is no problem
    truth = None if examined.truth is None else truth_from_json(examined.truth)
    return _capture_from_json(folder, raw, raw["frames"], truth, examined)


def read_network(folder: Path) -> Capture:
    """What `capture.json` says of the cameras of a capture that is still being written, or whose pictures come live.

    Returns:
        A capture of endlessly many frames, whatever the file says: which of them are there, nobody has looked. A camera
        without `rgb` has an empty pattern.

    Raises:
        UserError: lists every problem at once, each with field and remedy.
    """
    examined = examine_network(folder)
    refuse(examined.problems, f"capture {folder}")
    assert examined.capture is not None  # the validator returns it whenever there is no problem
    return _capture_from_json(folder, examined.capture, sys.maxsize, None, examined)


def _capture_from_json(
    folder: Path, raw: dict[str, Any], frames: int, truth: Truth | None, examined: Examination
) -> Capture:
    return Capture(
        folder,
        float(raw["fps"]),
        frames,
        tuple(_camera_from_json(camera) for camera in raw["cameras"]),
        truth,
        raw.get("missing", "drop"),
        tuple(str(warning) for warning in examined.warnings),
        examined.masks,
        GeographicOrigin(**{key: float(value) for key, value in raw["origin"].items()}) if "origin" in raw else None,
        raw.get("outside", False),
    )


def _camera_from_json(raw: dict[str, Any]) -> CaptureCamera:
    transform = np.array(raw["world_from_cam"], dtype=np.float64)
    rotation = transform[:3, :3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > EXACT_ROTATION:
        left, _, right = np.linalg.svd(rotation)  # the nearest rotation, Higham 1989, §2
        transform[:3, :3] = left @ right
    return CaptureCamera(
        name=raw["name"],
        width=raw["width"],
        height=raw["height"],
        K=np.array(raw["K"], dtype=np.float64),
        distortion_model=raw["distortion"]["model"],
        distortion=tuple(float(c) for c in raw["distortion"]["coefficients"]),
        world_from_cam=transform,
        rgb=raw.get("rgb", ""),
        mask=raw.get("mask"),
        depth=raw.get("depth"),
        time_offset_s=float(raw.get("time_offset_s", 0.0)),
        coverage=raw.get("coverage"),
        normal=raw.get("normal"),
        flow=raw.get("flow"),
        mask_kind=raw.get("mask_kind"),
    )


def write_capture_json(capture: Capture, *, overwrite: bool = False) -> None:
    """Write `truth.json` (where there is truth) and then `capture.json`, each under a temporary name first.

    A folder with `capture.json` is therefore complete, however the writer ends.

    Raises:
        UserError: there is a capture already and `overwrite` is False, or a number is not finite.
    """
    path = capture.folder / "capture.json"
    if path.exists() and not overwrite:
        raise UserError(
            "occupied", f"{path}: there is a capture already", "choose another folder or set overwrite=True"
        )
    head = {"format": FORMAT, "version": VERSION, "fps": capture.fps, "frames": capture.frames}
    body: dict[str, Any] = {**head, "cameras": [_camera_to_json(camera) for camera in capture.cameras]}
    if capture.missing != "drop":
        body["missing"] = capture.missing
    if capture.origin is not None:
        body["origin"] = dataclasses.asdict(capture.origin)
    if capture.outside:
        body["outside"] = True
    if capture.truth is not None:
        body["truth"] = "truth.json"
        write_json(capture.folder / "truth.json", truth_to_json(capture.truth), indent=None)
    write_json(path, body)


def calibration_to_json(camera: CalibratedCamera) -> dict[str, Any]:
    """What `capture.json`, and any file of cameras, says of how a camera sees and where it stands."""
    return {
        "name": camera.name,
        "width": camera.width,
        "height": camera.height,
        "K": camera.K.tolist(),
        "distortion": {"model": camera.distortion_model, "coefficients": list(camera.distortion)},
        "world_from_cam": camera.world_from_cam.tolist(),
    }


def _camera_to_json(camera: CaptureCamera) -> dict[str, Any]:
    raw = {**calibration_to_json(camera), "rgb": camera.rgb}
    optional = {kind: getattr(camera, kind) for kind in (*OPTIONAL_IMAGES, "mask_kind")}
    raw |= {key: value for key, value in optional.items() if value is not None}
    return raw | {"time_offset_s": camera.time_offset_s}


def rotate_world(capture: Capture, rotation: Float64[np.ndarray, "3 3"]) -> Capture:
    """The same capture in a turned world: x' = R x for cameras and truth. Images and boxes stay as they are.

    Stored normals are directions of the old world, so their patterns are dropped, and so is the place on the earth.

    Raises:
        UserError: `rotation` is not orthonormal with determinant 1 (within 1e-6).
    """
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
        raise UserError(
            "invalid", "rotate_world: `rotation` must be orthonormal with determinant 1", "normalise it first"
        )
    turn = np.eye(4)
    turn[:3, :3] = rotation
    cameras = tuple(
        dataclasses.replace(c, world_from_cam=turn @ c.world_from_cam, normal=None) for c in capture.cameras
    )
    truth = None if capture.truth is None else rotate_truth(capture.truth, rotation)
    return dataclasses.replace(capture, cameras=cameras, truth=truth, origin=None)
