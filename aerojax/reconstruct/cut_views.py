"""Cameras whose image's border cuts the object: where to aim their crops, and what of a crop lies in the image.

The box of a cut outline says little of the object's middle. Where it is, and how large, the cameras that show the whole
object tell; what the cut image shows must fit that.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64

FEWEST_WHOLE = 2
"""Cameras that must show the whole object before cut views are used: fewer do not tell where it is."""
_LARGEST = 2.0
"""How many times as wide an object may be in a cut view as in the others, in metres."""


def aimed_boxes(
    intrinsics: Float64[np.ndarray, "view 3 3"],
    world_from_cam: Float64[np.ndarray, "view 4 4"],
    boxes: Float64[np.ndarray, "view 4"],
    whole: Bool[np.ndarray, "view"],
    cut: Bool[np.ndarray, "view"],
    centre: Float64[np.ndarray, "3"],
) -> tuple[Float64[np.ndarray, "view 4"], Bool[np.ndarray, "view"]]:
    """Boxes for the crops of cut views, as if the object were whole in them.

    They are squares about the middle as the other views place it, as wide as the object is at most in those, or as
    what the cut image shows of it.

    Args:
        intrinsics, world_from_cam: of the cameras, in any one frame.
        boxes: of the outlines, x0 y0 x1 y1, pixels; what stands in those of views that are neither means nothing.
        whole: views that show the whole object, at least `FEWEST_WHOLE`.
        cut: views whose border cuts it.
        centre: of the object, metres, in the cameras' frame.

    Returns:
        All boxes, those of cut views replaced; which cut views show something that fits there.
    """
    in_camera = np.einsum("vji,vj->vi", world_from_cam[:, :3, :3], centre - world_from_cam[:, :3, 3])
    depth = in_camera[:, 2]
    ahead = depth > 0
    pixels = np.einsum("vij,vj->vi", intrinsics, in_camera)[:, :2] / np.where(ahead, depth, 1.0)[:, None]
    span = np.where(ahead, depth, 1.0) / intrinsics[:, 0, 0]
    side = np.maximum(boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1])
    expected = np.max((side * span)[whole]) / span
    # The half of the square that holds all that is seen.
    reach = np.max(np.abs(boxes - np.tile(pixels, 2)), axis=1)
    used = cut & ahead & (reach <= _LARGEST * expected / 2)
    half = np.maximum(expected / 2, reach)[:, None]
    square = np.concatenate([pixels - half, pixels + half], axis=1)
    return np.where(used[:, None], square, boxes), used


def known_pixels(
    crop_from_image: Float64[np.ndarray, "3 3"], *, size: int, image_size: tuple[int, int]
) -> Bool[np.ndarray, "{size} {size}"]:
    """Pixels of a crop that lie in the image (width, height): by one of its pixels, and by half of their own, at least.

    So far the crop's resampling reads beyond the border.
    """
    image_from_crop = np.linalg.inv(crop_from_image)
    along = np.arange(size) + 0.5
    columns, rows = np.meshgrid(along, along)
    places = np.stack([columns, rows, np.ones_like(columns)], axis=-1) @ image_from_crop.T
    ahead = places[..., 2] > 0
    x, y = np.moveaxis(places[..., :2] / np.where(ahead, places[..., 2], 1.0)[..., None], -1, 0)
    corners = np.array([[0, 0, 1], [size, size, 1]]) @ image_from_crop.T
    first, last = corners[:, :2] / corners[:, 2:]
    edge = 1.0 + 0.5 * float(np.max(np.abs(last - first))) / size
    width, height = image_size
    return ahead & (x >= edge) & (x <= width - edge) & (y >= edge) & (y <= height - edge)


def crops_to_read(
    valid: Bool[np.ndarray, "*time view"], cut: Bool[np.ndarray, "*time view"], least: int
) -> Bool[np.ndarray, "*time view"]:
    """Views whose crops a classifier reads: cut ones only in frames that have fewer than `least` others.

    It learns from whole objects; a part may look like something else.
    """
    whole = valid & ~cut
    return np.where(whole.sum(axis=-1, keepdims=True) < least, valid, whole)
