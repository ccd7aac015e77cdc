"""Cameras whose image's border cuts the object: where to aim their crops, and what of a crop lies in the image.

The box of a cut outline says little of the object's middle. Where it is, and how large, the cameras that show the whole
object tell; what the cut image shows must fit that. If only one shows it whole, the cut ones say how far it is: as far
as rays through the whole outline's box pass through theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

FEWEST_WHOLE = 1
"""Cameras that must show the whole object before cut views are used: parts alone do not tell how large it is."""
_LARGEST = 3.0
"""How many times as wide an object may be in a cut view as in the others, in metres."""
_ACROSS, _ALONG = 7, 9
"""Rays along each side of a box, and points on each of them, that are looked for in cut views."""
_LONGEST = 6.0
"""How many times as far apart as the object is wide these points may lie; views from nearly one side tell no more.
Below, the centre is off by a tenth of the object's size in the median and less than half of it in nine of ten cases;
above ten times, by 1.6 sizes (validation families before drawn rigs)."""
_SLACK = 1.0
"""Pixels by which boxes may be wrong."""


@dataclass(frozen=True, eq=False)
class SeenBoxes:
    """One object in one frame.

    intrinsics, world_from_cam: of the cameras, in any one frame. image_sizes: widths and heights, pixels.
    boxes: of the outlines, x0 y0 x1 y1, pixels; what stands in those of views that are neither means nothing.
    whole: views that show the whole object, at least `FEWEST_WHOLE`.
    cut: views whose border cuts it.
    """

    intrinsics: Float64[np.ndarray, "view 3 3"]
    world_from_cam: Float64[np.ndarray, "view 4 4"]
    image_sizes: Float64[np.ndarray, "view 2"]
    boxes: Float64[np.ndarray, "view 4"]
    whole: Bool[np.ndarray, "view"]
    cut: Bool[np.ndarray, "view"]


def aimed_boxes(
    seen: SeenBoxes, centre: Float64[np.ndarray, "3"]
) -> tuple[Float64[np.ndarray, "view 4"], Bool[np.ndarray, "view"]]:
    """Boxes for the crops of cut views, as if the object were whole in them.

    They are squares about the middle as the other views place it, as wide as the object is at most in those, or as
    what the cut image shows of it.

    Args:
        seen: what the cameras show.
        centre: of the object, metres, in the cameras' frame.

    Returns:
        All boxes, those of cut views replaced; which cut views show something that fits there.
    """
    intrinsics, world_from_cam, boxes = seen.intrinsics, seen.world_from_cam, seen.boxes
    in_camera = np.einsum("vji,vj->vi", world_from_cam[:, :3, :3], centre - world_from_cam[:, :3, 3])
    depth = in_camera[:, 2]
    ahead = depth > 0
    pixels = np.einsum("vij,vj->vi", intrinsics, in_camera)[:, :2] / np.where(ahead, depth, 1.0)[:, None]
    span = np.where(ahead, depth, 1.0) / intrinsics[:, 0, 0]
    side = np.maximum(boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1])
    expected = np.max((side * span)[seen.whole]) / span
    # The half of the square that holds all that is seen.
    reach = np.max(np.abs(boxes - np.tile(pixels, 2)), axis=1)
    used = seen.cut & ahead & (reach <= _LARGEST * expected / 2)
    half = np.maximum(expected / 2, reach)[:, None]
    square = np.concatenate([pixels - half, pixels + half], axis=1)
    return np.where(used[:, None], square, boxes), used


def centre_on_ray(seen: SeenBoxes) -> Float64[np.ndarray, "3"] | None:
    """Where on the central ray of the only view that shows the whole object this is.

    Of points on rays through that view's box, those count that lie in the box of one cut view and of every other one
    that has them in its image; the centre is as far as their median.

    Returns:
        Metres, in the cameras' frame; None where no point counts, or where they lie too far apart.
    """
    (whole,) = np.flatnonzero(seen.whole).tolist()
    origin, rays = seen.world_from_cam[whole, :3, 3], _rays_through(seen, whole)
    found = [_met(seen, view, origin, rays) for view in np.flatnonzero(seen.cut).tolist()]
    distances = np.concatenate([*found, np.zeros(0)])
    if not len(distances):
        return None
    first, middle, last = np.quantile(distances, (0.05, 0.5, 0.95))
    side = float(np.max(seen.boxes[whole, 2:] - seen.boxes[whole, :2]))
    if last - first > _LONGEST * middle * side / seen.intrinsics[whole, 0, 0]:
        return None
    return origin + middle * rays[len(rays) // 2]


def _rays_through(seen: SeenBoxes, view: int) -> Float64[np.ndarray, "ray 3"]:
    """Unit rays through a view's box, the one through its middle in the middle."""
    low, high = seen.boxes[view, :2], seen.boxes[view, 2:]
    columns, rows = np.meshgrid(*(low + np.linspace(0.0, 1.0, _ACROSS)[:, None] * (high - low)).T)
    pixels = np.stack([columns, rows, np.ones_like(columns)], axis=-1).reshape(-1, 3)
    rays = pixels @ np.linalg.inv(seen.intrinsics[view]).T @ seen.world_from_cam[view, :3, :3].T
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def _met(
    seen: SeenBoxes, view: int, origin: Float64[np.ndarray, "3"], rays: Float64[np.ndarray, "ray 3"]
) -> Float64[np.ndarray, "_"]:
    """Distances at which rays are in the box of a cut view, without those that another cut view contradicts."""
    projections = seen.intrinsics @ np.linalg.inv(seen.world_from_cam)[:, :3]
    one = projections[view]
    nearest, farthest = _through(one @ np.append(origin, 1.0), rays @ one[:, :3].T, seen.boxes[view])
    met = (farthest > nearest) & np.isfinite(farthest)
    reach = nearest[met, None] + np.linspace(0.0, 1.0, _ALONG) * (farthest - nearest)[met, None]
    points = origin + reach[..., None] * rays[met, None]
    fits = np.ones(reach.shape, bool)
    for other in np.flatnonzero(seen.cut & (np.arange(len(seen.cut)) != view)).tolist():
        there = points @ projections[other, :, :3].T + projections[other, :, 3]
        fits &= _fits(there, seen.boxes[other], seen.image_sizes[other])
    return reach[fits]


def _through(
    start: Float64[np.ndarray, "3"], along: Float64[np.ndarray, "ray 3"], box: Float64[np.ndarray, "4"]
) -> tuple[Float64[np.ndarray, "ray"], Float64[np.ndarray, "ray"]]:
    """Between which distances rays, in homogeneous pixels start + t along, are in a box before the camera."""
    x0, y0, x1, y1 = box
    sides = np.array([[1, 0, -x0], [-1, 0, x1], [0, 1, -y0], [0, -1, y1], [0, 0, 1.0]])  # positive within
    level, slope = sides @ start, along @ sides.T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = -level / slope
    nearest = np.max(np.where(slope > 0, at, 0.0), axis=1)
    farthest = np.min(np.where(slope < 0, at, np.inf), axis=1)
    never = np.any((slope == 0) & (level < 0), axis=1)
    return np.maximum(nearest, 0.0), np.where(never, -np.inf, farthest)


def _fits(
    homogeneous: Float64[np.ndarray, "ray point 3"],
    box: Float64[np.ndarray, "4"],
    image_size: Float64[np.ndarray, "2"],
) -> Bool[np.ndarray, "ray point"]:
    """Points in the box of a view, and those that it does not show."""
    ahead = homogeneous[..., 2] > 0
    pixels = homogeneous[..., :2] / np.where(ahead, homogeneous[..., 2], 1.0)[..., None]
    shown = ahead & np.all((pixels > 0) & (pixels < image_size), axis=-1)
    return ~shown | np.all((pixels > box[:2] - _SLACK) & (pixels < box[2:] + _SLACK), axis=-1)


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
