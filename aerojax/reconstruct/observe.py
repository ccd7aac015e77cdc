"""One object's crops in one frame: what the reconstructor gets."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float64

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import Box, Camera, FrameSet, Observation, Silhouette, View
from aerojax.geometry.triangulation import intersect_rays
from aerojax.reconstruct.crop import Crop, crop_cameras, crop_image
from aerojax.reconstruct.cut_views import SeenBoxes, aimed_boxes, centre_on_ray, known_pixels


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
    cut_views: bool = False,
) -> Observation:
    """Cut out the object in every camera that shows it whole, and on request in those whose border cuts it.

    Args:
        frames: the images.
        silhouettes: of the object, one entry a camera; at least two must be whole, or one with cut views.
        cameras: in the rig's frame.
        size: side of the crops, pixels.
        world_from_rig: kept in the observation.
        cut_views: whether cameras that show a part of the object count where that fits what the others show. Of one
            whole view alone, which is what is left where nothing fits, nothing can be reconstructed.

    Returns:
        Crops in a frame with the rig's axes and the object at its origin.
    """
    whole = np.array(usable(silhouettes))
    partly = np.array([one is not None and not one.whole for one in silhouettes]) & cut_views
    crops, centre, cut = _aim(silhouettes, cameras, whole, partly, size)
    valid = whole | cut
    in_crop = np.array(crops.camera.world_from_cam)
    in_crop[:, :3, 3] -= centre
    homographies = np.asarray(crops.crop_from_image)
    rgb = np.zeros((len(silhouettes), size, size, 3), np.float32)
    mask = np.zeros((len(silhouettes), size, size), np.float32)
    for index, (one, image) in enumerate(zip(silhouettes, frames.rgb, strict=True)):
        if one is not None and valid[index] and image is not None:
            rgb[index] = crop_image(image, homographies[index], size=size)
            mask[index] = crop_image(one.coverage, homographies[index], size=size)
    known = _known(homographies, cameras, cut, size)
    camera = Camera(jnp.asarray(crops.camera.K, jnp.float32), jnp.asarray(in_crop, jnp.float32), size, size)
    rig_from_crop = np.eye(4)
    rig_from_crop[:3, 3] = centre
    return Observation(
        frame=frames.frame,
        views=View(jnp.asarray(rgb), jnp.asarray(mask), camera, known),
        valid=valid,
        cut=cut,
        boxes=tuple(None if one is None else one.box for one in silhouettes),
        crop_from_image=homographies,
        rig_from_crop=rig_from_crop,
        world_from_rig=world_from_rig,
    )


def _aim(
    silhouettes: Sequence[Silhouette | None],
    cameras: Sequence[CaptureCamera],
    whole: Bool[np.ndarray, "view"],
    partly: Bool[np.ndarray, "view"],
    size: int,
) -> tuple[Crop, Float64[np.ndarray, "3"], Bool[np.ndarray, "view"]]:
    """Virtual cameras, where the rays of whole views meet, and which views that show a part are used."""
    K, poses = np.stack([camera.K for camera in cameras]), np.stack([camera.world_from_cam for camera in cameras])
    # Cameras that do not count get some window too: arrays have one shape however many there are.
    shown = [one.box if one is not None and one.whole else None for one in silhouettes]
    crops = crop_cameras(K, poses, np.array(_filled(shown), np.float64), size=size)
    sizes = np.array([(camera.width, camera.height) for camera in cameras], np.float64)
    boxes = np.array(_filled([None if one is None else one.box for one in silhouettes]), np.float64)
    seen = SeenBoxes(K, poses, sizes, boxes, whole, partly)
    centre = _meet(poses, crops, whole) if whole.sum() > 1 else centre_on_ray(seen)
    if centre is None:  # of one view alone nothing is told
        return crops, np.zeros(3), np.zeros_like(partly)
    if not partly.any():
        return crops, centre, partly
    boxes, cut = aimed_boxes(seen, centre)
    if not cut.any():
        return crops, centre, cut
    return crop_cameras(K, poses, boxes, size=size), centre, cut


def _meet(
    poses: Float64[np.ndarray, "view 4 4"], crops: Crop, whole: Bool[np.ndarray, "view"]
) -> Float64[np.ndarray, "3"]:
    with jax.enable_x64(True):
        weights = jnp.asarray(whole, jnp.float64)
        return np.asarray(intersect_rays(jnp.asarray(poses[:, :3, 3]), jnp.asarray(crops.ray), weights))


def _known(
    homographies: Float64[np.ndarray, "view 3 3"],
    cameras: Sequence[CaptureCamera],
    cut: Bool[np.ndarray, "view"],
    size: int,
) -> Bool[jax.Array, "view size size"] | None:
    """Pixels that the images speak of; None where they speak of all, which is faster."""
    if not cut.any():
        return None
    known = np.ones((len(cut), size, size), bool)
    for view in np.flatnonzero(cut).tolist():
        camera = cameras[view]
        known[view] = known_pixels(homographies[view], size=size, image_size=(camera.width, camera.height))
    return jnp.asarray(known)


def _filled(boxes: Sequence[Box | None]) -> list[Box]:
    fallback = next(box for box in boxes if box is not None)
    return [fallback if box is None else box for box in boxes]
