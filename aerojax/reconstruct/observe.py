"""One object's crops in one frame: what the reconstructor gets."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import Box, Camera, FrameSet, Observation, Silhouette, View
from aerojax.geometry.triangulation import intersect_rays
from aerojax.reconstruct.crop import crop_cameras, crop_image


def usable(silhouettes: Sequence[Silhouette | None]) -> list[bool]:
    """Cameras that show the whole object: a cut outline is not the object's own."""
    return [one is not None and one.whole for one in silhouettes]


def observe(
    frames: FrameSet,
    silhouettes: Sequence[Silhouette | None],
    cameras: Sequence[CaptureCamera],
    *,
    size: int,
    world_from_rig: Float64[np.ndarray, "4 4"],
) -> Observation:
    """Cut out the object in every camera that shows it whole.

    Args:
        frames: the images.
        silhouettes: of the object, one entry a camera; at least two must be whole.
        cameras: in the rig's frame.
        size: side of the crops, pixels.
        world_from_rig: kept in the observation.

    Returns:
        Crops in a frame with the rig's axes and the object at its origin.
    """
    seen = [one if ok else None for one, ok in zip(silhouettes, usable(silhouettes), strict=True)]
    valid = np.array([one is not None for one in seen])
    poses = np.stack([camera.world_from_cam for camera in cameras])
    # Cameras that do not count get some window too: arrays have one shape however many there are.
    boxes = np.array(_filled([None if one is None else one.box for one in seen]), np.float64)
    crops = crop_cameras(np.stack([camera.K for camera in cameras]), poses, boxes, size=size)
    with jax.enable_x64(True):
        weights = jnp.asarray(valid, jnp.float64)
        centre = np.asarray(intersect_rays(jnp.asarray(poses[:, :3, 3]), jnp.asarray(crops.ray), weights))
    in_crop = np.array(crops.camera.world_from_cam)
    in_crop[:, :3, 3] -= centre
    homographies = np.asarray(crops.crop_from_image)
    rgb = np.zeros((len(seen), size, size, 3), np.float32)
    mask = np.zeros((len(seen), size, size), np.float32)
    for index, (one, image) in enumerate(zip(seen, frames.rgb, strict=True)):
        if one is not None and image is not None:
            rgb[index] = crop_image(image, homographies[index], size=size)
            mask[index] = crop_image(one.coverage, homographies[index], size=size)
    camera = Camera(jnp.asarray(crops.camera.K, jnp.float32), jnp.asarray(in_crop, jnp.float32), size, size)
    rig_from_crop = np.eye(4)
    rig_from_crop[:3, 3] = centre
    return Observation(
        frame=frames.frame,
        views=View(jnp.asarray(rgb), jnp.asarray(mask), camera),
        valid=valid,
        boxes=tuple(None if one is None else one.box for one in silhouettes),
        crop_from_image=homographies,
        rig_from_crop=rig_from_crop,
        world_from_rig=world_from_rig,
    )


def _filled(boxes: Sequence[Box | None]) -> list[Box]:
    fallback = next(box for box in boxes if box is not None)
    return [fallback if box is None else box for box in boxes]
