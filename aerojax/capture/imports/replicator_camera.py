"""Replicator's camera_params as a camera of a capture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

from aerojax.capture.validate.findings import Findings, shown

UpAxis = Literal["z", "y"]
Z_UP_FROM = {
    "z": np.eye(3),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""Turns a stage's world into one with +Z up: x' = x, y' = -z, z' = y where +Y was up."""

_ORTHONORMAL = 1e-4  # what captures allow
_SAME_FOCAL = 0.01  # two statements of one focal length; float32 and rounding are far below


@dataclass(frozen=True, eq=False)
class RecordedPinhole:
    """Size, K in pixels, and `world_from_cam` in metres with OpenCV axes and +Z up; `unit` is metres a stage unit."""

    width: int
    height: int
    K: Float64[np.ndarray, "3 3"]
    world_from_cam: Float64[np.ndarray, "4 4"]
    unit: float


def parse_camera(raw: Any, up: UpAxis, found: Findings) -> RecordedPinhole | None:
    """Parse one camera_params; None where a problem was noted.

    The view matrix acts on row vectors: its transpose is camera-from-world in stage units, with OpenGL axes. The
    projection matrix gives focal lengths and principal point; where it is absent they follow from focal length,
    aperture and aperture offset (USD: u = W/2 - W·offset/aperture, v = H/2 + H·offset/aperture).
    """
    before = len(found.problems)
    if not isinstance(raw, dict):
        found.add("", f"must be an object, is {shown(raw)}", "record camera_params again")
        return None
    model = raw.get("cameraModel", "pinhole")
    if model != "pinhole":
        found.add("cameraModel", f"is {shown(model)}, only pinhole is read", "render with a pinhole camera")
    size = found.numbers(raw.get("renderProductResolution"), "renderProductResolution", 2)
    unit = found.number(raw.get("metersPerSceneUnit", 1.0), "metersPerSceneUnit")
    view = found.numbers(raw.get("cameraViewTransform"), "cameraViewTransform", 16)
    if size is None or view is None or unit is None or min(size) < 1 or unit <= 0:
        if unit is not None and unit <= 0:
            found.add("metersPerSceneUnit", f"must be positive, is {unit:g}", "correct the stage's unit")
        return None
    K = _intrinsics(raw, size, found)
    world_from_cam = _placement(np.array(view).reshape(4, 4), unit, up, found)
    if len(found.problems) > before:
        return None
    return RecordedPinhole(int(size[0]), int(size[1]), K, world_from_cam, unit)


def _placement(
    view: Float64[np.ndarray, "4 4"], unit: float, up: UpAxis, found: Findings
) -> Float64[np.ndarray, "4 4"]:
    rotation = view[:3, :3].T  # OpenGL camera from stage
    pose = np.eye(4)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _ORTHONORMAL or np.linalg.det(rotation) < 0:
        found.add("cameraViewTransform", "has scale or shear", "remove the scale of the camera's parents")
        return pose
    turn = Z_UP_FROM[up]
    pose[:3, :3] = turn @ rotation.T @ np.diag([1.0, -1.0, -1.0])
    pose[:3, 3] = turn @ (-rotation.T @ view[3, :3]) * unit
    return pose


def _intrinsics(raw: dict[str, Any], size: list[float], found: Findings) -> Float64[np.ndarray, "3 3"]:
    width, height = size
    stated = _from_aperture(raw, size)
    given = raw.get("cameraProjection")
    if given is None or given == [0.0] * 16:
        if stated is None:
            message = "is missing, and so is cameraFocalLength with cameraAperture"
            found.add("cameraProjection", message, "record camera_params again")
        return np.eye(3) if stated is None else stated
    numbers = found.numbers(given, "cameraProjection", 16)
    if numbers is None:
        return np.eye(3)
    P = np.array(numbers).reshape(4, 4)
    fx, fy = P[0, 0] * width / 2, P[1, 1] * height / 2
    K = np.array([[fx, 0.0, (1 - P[2, 0]) * width / 2], [0.0, fy, (1 + P[2, 1]) * height / 2], [0.0, 0.0, 1.0]])
    if fx <= 0 or fy <= 0 or P[2, 3] != -1:
        found.add("cameraProjection", "is no perspective projection for row vectors", "render with a pinhole camera")
    elif stated is not None and abs(stated[0, 0] / fx - 1) > _SAME_FOCAL:
        message = f"means fx = {fx:.1f} px, cameraFocalLength and cameraAperture {stated[0, 0]:.1f} px"
        found.add("cameraProjection", message, "record again; one of them is not of this image")
    return K


def _from_aperture(raw: dict[str, Any], size: list[float]) -> Float64[np.ndarray, "3 3"] | None:
    """K from film measures; pixels are square, as the renderer ignores the vertical aperture."""
    quiet = Findings("camera_params")
    focal = quiet.number(raw.get("cameraFocalLength"), "cameraFocalLength")
    aperture = quiet.numbers(raw.get("cameraAperture"), "cameraAperture", 2)
    offset = quiet.numbers(raw.get("cameraApertureOffset", [0.0, 0.0]), "cameraApertureOffset", 2)
    if focal is None or aperture is None or offset is None or focal <= 0 or min(aperture) <= 0:
        return None
    width, height = size
    f = width * focal / aperture[0]
    pixels_a_millimetre = width / aperture[0]
    centre = width / 2 - offset[0] * pixels_a_millimetre, height / 2 + offset[1] * pixels_a_millimetre
    return np.array([[f, 0.0, centre[0]], [0.0, f, centre[1]], [0.0, 0.0, 1.0]])
