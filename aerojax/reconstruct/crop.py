"""The virtual-camera crop: every view of the object becomes a small square pinhole image that looks straight at it.

Thesis §5.5.1 with the exact focal length: the window's half-angle decides it, so that every multi-view operation behind
stays exact. (The thesis declares one fixed focal length instead, which is true only in weak perspective.)
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from aerojax.core.types import Camera, pytree_dataclass
from aerojax.geometry.cameras import pixel_rays
from aerojax.geometry.rotations import rotation_between

MARGIN = 1.2
"""Side of the crop window over the longer side of the object's box (thesis §5.5.1)."""


@pytree_dataclass
class Crop:
    """A virtual camera and the homography that fills its image.

    camera: looks along `ray`; its centre is the real camera's.
    crop_from_image: 3×3, takes homogeneous pixels of the real image to those of the crop.
    ray: unit direction to the window's centre, world frame.
    half_angle: of the window, radians.
    """

    camera: Camera
    crop_from_image: Float[Array, "*batch 3 3"]
    ray: Float[Array, "*batch 3"]
    half_angle: Float[Array, "*batch"]


def crop_window(box: Float[Array, "4"], *, margin: float = MARGIN) -> Float[Array, "4 2"]:
    """Corners (pixels, clockwise from the top left) of the square about the centre of a box x0, y0, x1, y1."""
    centre = 0.5 * (box[:2] + box[2:])
    half = 0.5 * margin * jnp.maximum(box[2] - box[0], box[3] - box[1])
    signs = jnp.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], box.dtype)
    return centre[None, :] + half * signs


def crop_camera(camera: Camera, box: Float[Array, "4"], *, size: int, margin: float = MARGIN) -> Crop:
    """Turn a camera minimally until it looks at the centre of a box, with the focal length that the window asks for.

    d = K⁻¹(c, 1)/‖·‖, R_v takes d to +z, f = (size/2)/tan θ, H = K_v R_v K⁻¹ (stage-2 facts §3). θ is the largest
    angle of the window's four corners along either image axis, so that the whole window is inside.

    Args:
        camera: one real pinhole camera.
        box: x0, y0, x1, y1 of the object, pixels, exclusive ends, x1 > x0 and y1 > y0.
        size: side of the crop, pixels.
        margin: window side over the longer box side.
    """
    corners = crop_window(box, margin=margin)
    inverse_k = jnp.linalg.inv(camera.K)
    in_camera = Camera(camera.K, jnp.eye(4, dtype=camera.K.dtype), camera.width, camera.height)
    ray = pixel_rays(jnp.mean(corners, axis=0), in_camera)
    turn = rotation_between(ray, jnp.array([0.0, 0.0, 1.0], ray.dtype))
    turned = pixel_rays(corners, in_camera) @ turn.T
    tangent = jnp.max(jnp.abs(turned[:, :2] / turned[:, 2:]))
    half = size / 2
    focal = half / tangent
    zero, one = jnp.zeros_like(focal), jnp.ones_like(focal)
    rows = ((focal, zero, half * one), (zero, focal, half * one), (zero, zero, one))
    virtual_k = jnp.stack([jnp.stack(row) for row in rows])
    pose = camera.world_from_cam.at[:3, :3].set(camera.world_from_cam[:3, :3] @ turn.T)
    return Crop(
        camera=Camera(virtual_k, pose, size, size),
        crop_from_image=virtual_k @ turn @ inverse_k,
        ray=camera.world_from_cam[:3, :3] @ ray,
        half_angle=jnp.arctan(tangent),
    )


def crop_cameras(
    intrinsics: Float[np.ndarray, "view 3 3"],
    world_from_cam: Float[np.ndarray, "view 4 4"],
    boxes: Float[np.ndarray, "view 4"],
    *,
    size: int,
) -> Crop:
    """`crop_camera` for many views in float64, as host arrays; cameras stand hundreds of metres from their crops."""
    with jax.enable_x64(True):
        camera = Camera(jnp.asarray(intrinsics), jnp.asarray(world_from_cam), 0, 0)
        crops = _crop_many(camera, jnp.asarray(boxes, jnp.float64), size)
        return jax.tree.map(np.asarray, crops)


@jax.jit(static_argnums=2)
def _crop_many(camera: Camera, boxes: Float[Array, "view 4"], size: int) -> Crop:
    return jax.vmap(lambda c, b: crop_camera(c, b, size=size))(camera, boxes)


@dataclass(frozen=True)
class CropSource:
    """What of an image a crop depends on.

    window: x0 y0 x1 y1, whole pixels inside the image, ends exclusive.
    blur: standard deviation in pixels of the low-pass that goes before the resampling; 0 for none.
    """

    window: tuple[int, int, int, int]
    blur: float


def crop_source(crop_from_image: Float[np.ndarray, "3 3"], *, size: int, image_size: tuple[int, int]) -> CropSource:
    """The window of an image (width, height) that a crop is resampled from, and how much it is low-passed first."""
    corners = np.array([[0, 0, 1], [size, 0, 1], [0, size, 1], [size, size, 1]]) @ np.linalg.inv(crop_from_image).T
    corners = corners[:, :2] / corners[:, 2:]
    shrink = float(np.max(corners[3] - corners[0])) / size
    blur = 0.5 * float(np.sqrt(shrink * shrink - 1.0)) + 1e-3 if shrink > 1.0 else 0.0
    # Only what the crop can depend on is filtered: OpenCV's kernel reaches 4σ, the interpolation 2 pixels.
    reach = int(np.ceil(4.0 * blur)) + 4
    width, height = image_size
    x0, y0 = (int(v) for v in np.clip(np.floor(corners.min(axis=0)) - reach, 0, (width - 1, height - 1)))
    x1, y1 = (int(v) for v in np.clip(np.ceil(corners.max(axis=0)) + reach, (x0 + 1, y0 + 1), (width, height)))
    return CropSource((x0, y0, x1, y1), blur)


def crop_image(
    image: Float[np.ndarray, "height width *channel"],
    crop_from_image: Float[np.ndarray, "3 3"],
    *,
    size: int,
    outside: float = 0.0,
) -> Float[np.ndarray, "size size *channel"]:
    """Resample an image into a crop.

    Args:
        image: float32 colours or coverage of the real image.
        crop_from_image: homography between continuous pixel coordinates (centres at +0.5).
        size: side of the crop.
        outside: value beyond the image's border.

    Returns:
        float32. Enlarged with cubic interpolation; where the crop is coarser than the image, the image is low-passed
        first so that thin rods do not fall between samples.
    """
    height, width = image.shape[:2]
    source = crop_source(crop_from_image, size=size, image_size=(width, height))
    x0, y0, x1, y1 = source.window
    return crop_part(image[y0:y1, x0:x1], source, crop_from_image, size=size, outside=outside)


def crop_part(
    part: Float[np.ndarray, "rows columns *channel"],
    source: CropSource,
    crop_from_image: Float[np.ndarray, "3 3"],
    *,
    size: int,
    outside: float = 0.0,
) -> Float[np.ndarray, "size size *channel"]:
    """`crop_image` from the window that `crop_source` names, for images of which nothing else exists."""
    if source.blur > 0.0:
        part = cv2.GaussianBlur(part, (0, 0), source.blur)
    # OpenCV's first pixel centre is (0, 0), ours (0.5, 0.5).
    half = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
    x0, y0 = source.window[:2]
    matrix = np.linalg.inv(half) @ crop_from_image @ half @ np.array([[1.0, 0, x0], [0, 1.0, y0], [0, 0, 1.0]])
    value = (outside,) * 4
    warped = cv2.warpPerspective(
        part, matrix, (size, size), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT, borderValue=value
    )
    return np.clip(warped, 0.0, 1.0)


def small_crops(
    rgb: Float[np.ndarray, "view size size 3"], mask: Float[np.ndarray, "view size size"], *, size: int
) -> Float32[np.ndarray, "view {size} {size} 4"]:
    """Crops as classifiers of views read them: sRGB times coverage, and coverage, averaged over equal areas.

    Colours are multiplied first, so that nothing of the background is left.

    Args:
        rgb, mask: crops of any side, 0..1.
        size: side of what is returned, pixels.
    """
    whole = np.concatenate([rgb * mask[..., None], mask[..., None]], axis=-1).astype(np.float32)
    return np.stack([cv2.resize(one, (size, size), interpolation=cv2.INTER_AREA) for one in whole])
