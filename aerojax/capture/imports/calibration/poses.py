"""Cameras from images with poses: a structure-from-motion model has a pose an image, a capture one a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

import numpy as np
from jaxtyping import Float64

from aerojax.capture.imports.calibration.base import CalibratedCamera
from aerojax.core.errors import UserError


@dataclass(frozen=True)
class Stillness:
    """How far the poses of one camera's images may lie apart; their mean is taken.

    share: of positions, as a share of the network's size.
    degrees: of directions.
    """

    share: float = 1e-3
    degrees: float = 0.3


def camera_of(file: str) -> str:
    """The camera that took an image, by the name of the folder that it lies in; by its own where it lies in none."""
    path = PurePosixPath(file)
    folders = [part for part in path.parts[:-1] if part not in ("images", "rgb", ".", "..")]
    return folders[-1] if folders else path.stem


def still_cameras(images: Sequence[CalibratedCamera], where: str, still: Stillness) -> tuple[CalibratedCamera, ...]:
    """One camera for all images of one name, sorted by name.

    Args:
        images: one image each, named by its camera, with one file.
        where: the calibration's file, for messages.
        still: how far poses may lie apart.

    Raises:
        UserError: a camera moves or changes its lens.
    """
    groups: dict[str, list[CalibratedCamera]] = {}
    for image in images:
        groups.setdefault(image.name, []).append(image)
    centres = np.stack([image.world_from_cam[:3, 3] for image in images]) if images else np.zeros((1, 3))
    size = float(np.linalg.norm(centres.max(axis=0) - centres.min(axis=0)))
    return tuple(_one_camera(groups[name], where, still, size) for name in sorted(groups))


def _one_camera(images: Sequence[CalibratedCamera], where: str, still: Stillness, size: float) -> CalibratedCamera:
    first = images[0]
    for image in images:
        lens = image.distortion_model, image.distortion, image.width, image.height
        if not np.allclose(image.K, first.K) or lens != (
            first.distortion_model,
            first.distortion,
            first.width,
            first.height,
        ):
            raise UserError(
                "mismatch",
                f"{where}: camera {first.name} has several lenses or sizes",
                "give each camera a folder of its own, and calibrate its images with one lens",
            )
    poses = np.stack([image.world_from_cam for image in images])
    mean = _mean_pose(poses)
    apart = float(np.linalg.norm(poses[:, :3, 3] - mean[:3, 3], axis=1).max())
    turns = np.einsum("nij,ij->n", poses[:, :3, :3], mean[:3, :3])
    turned = float(np.degrees(np.arccos(np.clip((turns.min() - 1) / 2, -1, 1))))
    if apart > still.share * size or turned > still.degrees:
        raise UserError(
            "mismatch",
            f"{where}: camera {first.name} moves by {apart:.3g} (of {size:.3g}) and {turned:.2g}° between its images",
            "cameras must stand still; give each its own folder of images, or raise calibration.still",
        )
    ordered = sorted(images, key=lambda image: image.files)
    files = tuple(file for image in ordered for file in image.files)
    masks = tuple(mask for image in ordered for mask in image.masks)
    return replace(first, world_from_cam=mean, files=files, masks=masks)


def _mean_pose(poses: Float64[np.ndarray, "image 4 4"]) -> Float64[np.ndarray, "4 4"]:
    """Mean position, and the rotation nearest to the mean of the matrices (Moakher 2002, §3)."""
    mean = poses.mean(axis=0)
    left, _, right = np.linalg.svd(mean[:3, :3])
    mean[:3, :3] = left @ right
    return mean
