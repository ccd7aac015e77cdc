"""Rendering of one object in front of a dome: cast rays only where it can be, and paste."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from aerojax.capture.format import CaptureCamera
from kernels.raytrace import Lighting, MeshCaster

MASK_THRESHOLD = 0.25
"""Least coverage of a mask pixel: below one half, because a rotor blade or wing tip seldom fills half a pixel."""


@dataclass(frozen=True)
class Rendering:
    """One image of one object.

    rgb: sRGB 0..1. mask: the object's pixels. depth: z of the surface at pixel centres, metres, 0 where none.
    """

    rgb: Float[np.ndarray, "height width 3"]
    mask: Bool[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]


def srgb_from_linear(linear: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Encode linear light as sRGB (IEC 61966-2-1), 0..1."""
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055).astype(np.float32)


def linear_from_srgb(encoded: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Decode sRGB to linear light (IEC 61966-2-1), 0..1."""
    power = np.power((np.maximum(encoded, 0.0) + 0.055) / 1.055, 2.4)
    return np.where(encoded <= 0.04045, encoded / 12.92, power).astype(np.float32)


def project(points_world: Float[np.ndarray, "point 3"], camera: CaptureCamera) -> Float[np.ndarray, "point 2"]:
    """Pixels of world points in float64; NaN behind the camera."""
    rotation, centre = camera.world_from_cam[:3, :3], camera.world_from_cam[:3, 3]
    in_camera = (points_world - centre) @ rotation
    depth = np.where(in_camera[:, 2:] > 1e-6, in_camera[:, 2:], np.nan)
    return (in_camera / depth) @ camera.K[:2].T


def projected_box(points_world: Float[np.ndarray, "point 3"], camera: CaptureCamera) -> Float[np.ndarray, "4"] | None:
    """Box x0, y0, x1, y1 of projected points, pixels, not clipped; None if any point is behind the camera."""
    pixels = project(points_world, camera)
    if np.isnan(pixels).any():
        return None
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def render_object(
    caster: MeshCaster,
    vertices_world: Float[np.ndarray, "vertex 3"],
    origin: Float[np.ndarray, "3"],
    camera: CaptureCamera,
    *,
    lighting: Lighting,
    samples: int,
    dome: tuple[float, float, float],
) -> Rendering:
    """Render the posed mesh of `caster` as a camera sees it.

    Args:
        caster: posed at `vertices_world` - `origin`, so that float32 rays stay precise far from the world's zero.
        vertices_world: metres; they bound where rays are cast.
        origin: near the object, metres, world.
        camera: pinhole.
        lighting: linear light; directions in the world frame.
        samples: rays along each side of a pixel.
        dome: sRGB background.
    """
    rgb = np.empty((camera.height, camera.width, 3), np.float32)
    rgb[:] = dome
    mask = np.zeros((camera.height, camera.width), bool)
    depth = np.zeros((camera.height, camera.width), np.float32)
    window = _window(vertices_world, camera)
    if window is not None:
        local = camera.world_from_cam.copy()
        local[:3, 3] -= origin
        cast = caster.cast(camera.K, local, window, lighting=lighting, samples=samples)
        x0, y0, x1, y1 = window
        alpha = cast.coverage[..., None]
        behind = linear_from_srgb(np.asarray(dome, np.float32))
        rgb[y0:y1, x0:x1] = srgb_from_linear(alpha * cast.colour + (1 - alpha) * behind)
        mask[y0:y1, x0:x1] = cast.coverage >= MASK_THRESHOLD
        depth[y0:y1, x0:x1] = cast.depth
    return Rendering(rgb, mask, depth)


def _window(vertices_world: np.ndarray, camera: CaptureCamera) -> tuple[int, int, int, int] | None:
    """Whole pixels that the object can touch, inside the image; None if there are none."""
    box = projected_box(vertices_world, camera)
    if box is None:
        return None
    x0, y0 = np.maximum(np.floor(box[:2]).astype(int), 0)
    x1, y1 = np.minimum(np.ceil(box[2:]).astype(int), (camera.width, camera.height))
    return (int(x0), int(y0), int(x1), int(y1)) if x1 > x0 and y1 > y0 else None
