"""COLMAP text models with rigs and frames: one a sequence, `<split>/<sequence>/{images,masks,sparse/0}`.

The network is one rig, an instant is one frame of it, so a sequence of T instants has T rig poses (equal, as the
cameras stand still) and up to T images a camera. Poses are world-to-camera, quaternions w x y z; pixels have the centre
of the top-left one at (0.5, 0.5), as here. `points3D.txt` holds the origin of each object's body at each instant that
two cameras see it, each with its projections as its track. World and unit are those of the capture (+Z up, metres).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.core.files import write_text
from aerojax.data.exports.annotations import image_annotations
from aerojax.data.exports.images import place_image, place_mask, recorded_frames
from aerojax.data.exports.sources import (
    ExportOptions,
    SourceSequence,
    camera_names,
    require_no_skew,
)
from aerojax.geometry.cameras import invert_rigid, project_points
from aerojax.geometry.rotations import quaternion_from_rotation

_GREY = "128 128 128"


@dataclass
class _Image:
    """An image of the model; `points` are its keypoints: u, v and the id of the point that they show."""

    number: int
    camera_index: int
    frame: int
    name: str
    points: list[tuple[float, float, int]] = field(default_factory=list)


def write_sequence(capture: Capture, sequence: SourceSequence, folder: Path, options: ExportOptions) -> dict[str, Any]:
    """Write one sequence's model, images and masks (`masks/<image>.png`, 0 = left out)."""
    require_no_skew(capture, "COLMAP")
    target = folder / sequence.split / sequence.name
    images = _place_images(capture, target, options)
    points = _place_points(capture, images)
    sparse = target / "sparse" / "0"
    poses = [_pose_numbers(invert_rigid(camera.world_from_cam)) for camera in capture.cameras]
    files = {
        "cameras": "".join(_camera_line(index + 1, camera) for index, camera in enumerate(capture.cameras)),
        "images": "".join(_image_lines(image, poses[image.camera_index]) for image in images),
        "points3D": "".join(points),
        "rigs": _rig_line(capture),
        "frames": _frame_lines(images, poses[0]),
    }
    for name, text in files.items():
        write_text(sparse / f"{name}.txt", text)
    return {}


def _place_images(capture: Capture, target: Path, options: ExportOptions) -> list[_Image]:
    """Images in order of frame and camera, numbered from 1."""
    recorded = [set(recorded_frames(capture, index)) for index in range(len(capture.cameras))]
    images: list[_Image] = []
    for frame in range(capture.frames):
        for camera_index, name in enumerate(camera_names(capture)):
            if frame not in recorded[camera_index]:
                continue
            stem = target / "images" / name / f"{frame:06d}"
            path = place_image(capture, camera_index, frame, stem, options.images)
            place_mask(capture, camera_index, frame, target / "masks" / name / f"{path.name}.png")
            images.append(_Image(len(images) + 1, camera_index, frame, f"{name}/{path.name}"))
    return images


def _place_points(capture: Capture, images: list[_Image]) -> list[str]:
    """Lines of points3D.txt; the keypoints are added to the images."""
    seen: dict[tuple[int, int], list[tuple[_Image, tuple[float, float]]]] = {}
    positions: dict[tuple[int, int], tuple[float, float, float]] = {}
    for image in images if capture.truth is not None else ():
        camera = capture.cameras[image.camera_index]
        for annotation in image_annotations(capture, image.camera_index, image.frame):
            pixel = _pixel(np.array(annotation.state.position), camera)
            if pixel is not None:
                key = image.frame, annotation.item.object_id
                seen.setdefault(key, []).append((image, pixel))
                positions[key] = annotation.state.position
    lines = []
    for key, views in seen.items():
        if len(views) < 2:
            continue
        number, track = len(lines) + 1, ""
        for image, (u, v) in views:
            track += f" {image.number} {len(image.points)}"
            image.points.append((u, v, number))
        lines.append(f"{number} {_numbers(positions[key])} {_GREY} 0{track}\n")
    return lines


def _pixel(point: Float64[np.ndarray, "3"], camera: CaptureCamera) -> tuple[float, float] | None:
    """Pixel of a world point; None behind the camera or outside the image."""
    u, v = project_points(point, camera, behind=np.nan).tolist()
    return (u, v) if 0 <= u < camera.width and 0 <= v < camera.height else None


def _numbers(values: Sequence[float]) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def _pose_numbers(transform: Float64[np.ndarray, "4 4"]) -> str:
    with jax.enable_x64(True):
        quaternion = np.asarray(quaternion_from_rotation(jnp.asarray(transform[:3, :3])))
    return _numbers([*quaternion.tolist(), *transform[:3, 3].tolist()])


def _camera_line(number: int, camera: CaptureCamera) -> str:
    K = camera.K
    parameters = _numbers([K[0, 0], K[1, 1], K[0, 2], K[1, 2]])
    return f"{number} PINHOLE {camera.width} {camera.height} {parameters}\n"


def _image_lines(image: _Image, pose: str) -> str:
    points = " ".join(f"{u:.17g} {v:.17g} {number}" for u, v, number in image.points)
    return f"{image.number} {pose} {image.camera_index + 1} {image.name}\n{points}\n"


def _rig_line(capture: Capture) -> str:
    """Rig 1: the first camera is its frame of reference, the others carry sensor-from-rig poses."""
    rig_from_world = invert_rigid(capture.cameras[0].world_from_cam)
    text = f"1 {len(capture.cameras)} CAMERA 1"
    for index, camera in enumerate(capture.cameras[1:], start=2):
        sensor_from_rig = invert_rigid(camera.world_from_cam) @ np.linalg.inv(rig_from_world)
        text += f" CAMERA {index} 1 {_pose_numbers(sensor_from_rig)}"
    return text + "\n"


def _frame_lines(images: list[_Image], rig_pose: str) -> str:
    by_frame: dict[int, list[_Image]] = {}
    for image in images:
        by_frame.setdefault(image.frame, []).append(image)
    text = ""
    for frame, members in by_frame.items():
        data = " ".join(f"CAMERA {image.camera_index + 1} {image.number}" for image in members)
        text += f"{frame + 1} 1 {rig_pose} {len(members)} {data}\n"
    return text


def finish(folder: Path, parts: Sequence[Path]) -> None:
    """Models stand alone: nothing is merged."""
