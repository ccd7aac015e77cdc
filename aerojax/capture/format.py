"""A capture on disk: `capture.json`, one folder of frames (or one video) a camera, and optionally `truth.json`."""

from __future__ import annotations

import dataclasses
import json
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from aerojax.capture.validate import FORMAT, VERSION, examine
from aerojax.errors import UserError
from aerojax.geometry.rotations import quaternion_from_rotation, quaternion_multiply
from aerojax.types import Camera


@dataclass(frozen=True)
class ObjectState:
    """Where one object is in one frame.

    frame: index in the capture.
    position: the body's origin, metres, world frame.
    orientation_wxyz: unit quaternion, world from body.
    bbox: by camera name, x0 y0 x1 y1 in pixels of the undistorted image, ends exclusive.
    visible: by camera name; a camera that is absent does not see the object.
    """

    frame: int
    position: tuple[float, float, float]
    orientation_wxyz: tuple[float, float, float, float]
    bbox: Mapping[str, tuple[float, float, float, float]]
    visible: Mapping[str, bool]


@dataclass(frozen=True)
class TrackedObject:
    """One object of the truth; `object_id` is its value in the masks, `frames` are sorted and complete."""

    object_id: int
    class_name: str
    identity: str
    frames: tuple[ObjectState, ...]
    source: str | None = None
    licence: str | None = None


@dataclass(frozen=True)
class Truth:
    """What really flew."""

    objects: tuple[TrackedObject, ...]


@dataclass(frozen=True, eq=False)
class CaptureCamera:
    """One calibrated camera of a capture and the patterns of its files (relative, `{frame}` or `{frame:0Nd}`).

    K: pixels; the centre of the top-left pixel is (0.5, 0.5).
    distortion_model: "none", "opencv" or "opencv_fisheye"; images are undistorted on reading and keep K.
    world_from_cam: rigid transform, metres, OpenCV axes.
    rgb: file pattern or one video file. mask, depth: file patterns or None.
    time_offset_s: how late the camera's clock is; what it took as frame j shows time j/fps + offset.
    """

    name: str
    width: int
    height: int
    K: Float64[np.ndarray, "3 3"]
    distortion_model: str
    distortion: tuple[float, ...]
    world_from_cam: Float64[np.ndarray, "4 4"]
    rgb: str
    mask: str | None
    depth: str | None
    time_offset_s: float

    def pinhole(self) -> Camera:
        """The camera that took the undistorted images, as float32 arrays for JAX."""
        transform = jnp.asarray(self.world_from_cam, jnp.float32)
        return Camera(jnp.asarray(self.K, jnp.float32), transform, width=self.width, height=self.height)


@dataclass(frozen=True, eq=False)
class Capture:
    """A network of cameras that watched for `frames` frames at `fps` frames per second."""

    folder: Path
    fps: float
    frames: int
    cameras: tuple[CaptureCamera, ...]
    truth: Truth | None


def read_capture(folder: Path) -> Capture:
    """Validate a capture and read everything but its images.

    Raises:
        UserError: lists every problem at once, each with file, field and remedy.
    """
    examined = examine(folder)
    if examined.problems:
        count = len(examined.problems)
        lines = "\n".join(f"  {problem}" for problem in examined.problems)
        raise UserError(f"capture {folder} has {count} problem{'s' if count > 1 else ''}:\n{lines}")
    raw = examined.capture
    assert raw is not None  # the validator returns it whenever there is no problem
    cameras = tuple(_camera_from_json(camera) for camera in raw["cameras"])
    truth = None if examined.truth is None else _truth_from_json(examined.truth)
    return Capture(folder, float(raw["fps"]), raw["frames"], cameras, truth)


def _camera_from_json(raw: dict[str, Any]) -> CaptureCamera:
    return CaptureCamera(
        name=raw["name"],
        width=raw["width"],
        height=raw["height"],
        K=np.array(raw["K"], dtype=np.float64),
        distortion_model=raw["distortion"]["model"],
        distortion=tuple(float(c) for c in raw["distortion"]["coefficients"]),
        world_from_cam=np.array(raw["world_from_cam"], dtype=np.float64),
        rgb=raw["rgb"],
        mask=raw.get("mask"),
        depth=raw.get("depth"),
        time_offset_s=float(raw.get("time_offset_s", 0.0)),
    )


def _truth_from_json(raw: dict[str, Any]) -> Truth:
    return Truth(
        tuple(
            TrackedObject(
                object_id=item["id"],
                class_name=item["class"],
                identity=item["identity"],
                frames=tuple(sorted(map(_state_from_json, item["frames"]), key=lambda state: state.frame)),
                source=item.get("source"),
                licence=item.get("licence"),
            )
            for item in raw["objects"]
        )
    )


def _state_from_json(raw: dict[str, Any]) -> ObjectState:
    x, y, z = (float(v) for v in raw["position"])
    qw, qx, qy, qz = (float(v) for v in raw["orientation_wxyz"])
    boxes = {camera: (float(a), float(b), float(c), float(d)) for camera, (a, b, c, d) in raw["bbox"].items()}
    return ObjectState(raw["frame"], (x, y, z), (qw, qx, qy, qz), boxes, dict(raw["visible"]))


def write_capture_json(capture: Capture, *, overwrite: bool = False) -> None:
    """Write `truth.json` (where there is truth) and then `capture.json`, each under a temporary name first.

    A folder with `capture.json` is therefore complete, however the writer ends.

    Raises:
        UserError: there is a capture already and `overwrite` is False, or a number is not finite.
    """
    path = capture.folder / "capture.json"
    if path.exists() and not overwrite:
        raise UserError(f"{path}: there is a capture already; choose another folder or set overwrite=True")
    head = {"format": FORMAT, "version": VERSION, "fps": capture.fps, "frames": capture.frames}
    body: dict[str, Any] = {**head, "cameras": [_camera_to_json(camera) for camera in capture.cameras]}
    capture.folder.mkdir(parents=True, exist_ok=True)
    if capture.truth is not None:
        body["truth"] = "truth.json"
        _write_json(capture.folder / "truth.json", {"objects": [_object_to_json(o) for o in capture.truth.objects]})
    _write_json(path, body, indent=1)


def _camera_to_json(camera: CaptureCamera) -> dict[str, Any]:
    raw: dict[str, Any] = {
        "name": camera.name,
        "width": camera.width,
        "height": camera.height,
        "K": camera.K.tolist(),
        "distortion": {"model": camera.distortion_model, "coefficients": list(camera.distortion)},
        "world_from_cam": camera.world_from_cam.tolist(),
        "rgb": camera.rgb,
    }
    optional = {"mask": camera.mask, "depth": camera.depth}
    raw |= {key: value for key, value in optional.items() if value is not None}
    return raw | {"time_offset_s": camera.time_offset_s}


def _object_to_json(item: TrackedObject) -> dict[str, Any]:
    optional = {"source": item.source, "licence": item.licence}
    return {
        "id": item.object_id,
        "class": item.class_name,
        "identity": item.identity,
        **{key: value for key, value in optional.items() if value is not None},
        "frames": [dataclasses.asdict(state) for state in item.frames],
    }


def _write_json(path: Path, value: dict[str, Any], indent: int | None = None) -> None:
    try:
        text = json.dumps(value, indent=indent, allow_nan=False)
    except ValueError:
        raise UserError(f"{path}: a number to write is NaN or infinite; check poses and calibration") from None
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".tmp")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text + "\n")
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def rotate_world(capture: Capture, rotation: Float64[np.ndarray, "3 3"]) -> Capture:
    """The same capture in a turned world: x' = R x for cameras and truth. Images and boxes stay as they are.

    Raises:
        UserError: `rotation` is not orthonormal with determinant 1 (within 1e-6).
    """
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
        raise UserError("rotate_world: `rotation` must be orthonormal with determinant 1; normalise it first")
    turn = np.eye(4)
    turn[:3, :3] = rotation
    cameras = tuple(dataclasses.replace(c, world_from_cam=turn @ c.world_from_cam) for c in capture.cameras)
    truth = None if capture.truth is None else _rotate_truth(capture.truth, rotation)
    return dataclasses.replace(capture, cameras=cameras, truth=truth)


def _rotate_truth(truth: Truth, rotation: Float64[np.ndarray, "3 3"]) -> Truth:
    return Truth(tuple(dataclasses.replace(o, frames=_rotate_states(o.frames, rotation)) for o in truth.objects))


def _rotate_states(states: tuple[ObjectState, ...], rotation: Float64[np.ndarray, "3 3"]) -> tuple[ObjectState, ...]:
    if not states:
        return states
    positions = np.array([state.position for state in states]) @ rotation.T
    with jax.enable_x64(True):  # the truth is in double precision and stays so
        turn = quaternion_from_rotation(jnp.asarray(rotation))
        before = jnp.asarray(np.array([state.orientation_wxyz for state in states]))
        after = np.asarray(quaternion_multiply(jnp.broadcast_to(turn, before.shape), before))
    return tuple(
        dataclasses.replace(state, position=tuple(p.tolist()), orientation_wxyz=tuple(q.tolist()))
        for state, p, q in zip(states, positions, after, strict=True)
    )
