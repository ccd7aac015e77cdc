"""Pinhole cameras: projection, back-projection and rigid transforms. OpenCV axes, pixel centres at +0.5."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from aerojax.core.types import Camera
from aerojax.geometry.rotations import normalise


def invert_rigid(transform: Float[Array, "*batch 4 4"]) -> Float[Array, "*batch 4 4"]:
    """Inverse of a rigid transform [R t; 0 1]: [Rᵀ -Rᵀt; 0 1]."""
    rotation = jnp.swapaxes(transform[..., :3, :3], -1, -2)
    translation = -rotation @ transform[..., :3, 3:]
    top = jnp.concatenate([rotation, translation], axis=-1)
    return jnp.concatenate([top, transform[..., 3:, :]], axis=-2)


def transform_points(transform: Float[Array, "4 4"], points: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3"]:
    """Apply a rigid transform `dst_from_src` to points in the source frame, metres."""
    return points @ transform[:3, :3].T + transform[:3, 3]


def points_in_camera(points_world: Float[Array, "*batch 3"], camera: Camera) -> Float[Array, "*batch 3"]:
    """World points in the camera's frame, metres; z is the depth along the optical axis."""
    rotation, centre = camera.world_from_cam[:3, :3], camera.world_from_cam[:3, 3]
    return (points_world - centre) @ rotation


def project_points(points_world: Float[Array, "*batch 3"], camera: Camera) -> Float[Array, "*batch 2"]:
    """Project world points to pixels with a pinhole camera.

    u = fx·X/Z + skew·Y/Z + cx, v = fy·Y/Z + cy (thesis Eq. 3.1; Hartley & Zisserman 2004, §6.1).

    Args:
        points_world: positions, metres, world frame.
        camera: one OpenCV camera; use `jax.vmap` for many.

    Returns:
        Pixel coordinates (u right, v down). Not clipped to the image; meaningless for points behind the camera.
    """
    in_camera = points_in_camera(points_world, camera)
    z = in_camera[..., 2:]
    safe = jnp.where(jnp.abs(z) < 1e-9, 1e-9, z)
    return (in_camera / safe) @ camera.K[:2].T


def pixel_rays(pixels: Float[Array, "*batch 2"], camera: Camera) -> Float[Array, "*batch 3"]:
    """Unit world-frame directions of the rays through pixels."""
    ones = jnp.ones((*pixels.shape[:-1], 1), pixels.dtype)
    homogeneous = jnp.concatenate([pixels, ones], axis=-1)
    in_camera = homogeneous @ jnp.linalg.inv(camera.K).T
    return normalise(in_camera @ camera.world_from_cam[:3, :3].T)


def unproject_depth(
    pixels: Float[Array, "*batch 2"], depth: Float[Array, "*batch"], camera: Camera
) -> Float[Array, "*batch 3"]:
    """World points at depth z along the optical axis (metres) behind pixels; the inverse of `project_points`."""
    ones = jnp.ones((*pixels.shape[:-1], 1), pixels.dtype)
    in_camera = jnp.concatenate([pixels, ones], axis=-1) @ jnp.linalg.inv(camera.K).T * depth[..., None]
    return transform_points(camera.world_from_cam, in_camera)


def look_at(
    centre: Float[Array, "3"], target: Float[Array, "3"], up: Float[Array, "3"] | None = None
) -> Float[Array, "4 4"]:
    """`world_from_cam` of a camera at `centre` whose +z looks at `target` and whose -y leans towards `up` (+Z)."""
    up = jnp.array([0.0, 0.0, 1.0], centre.dtype) if up is None else up
    forward = normalise(target - centre)
    right = normalise(jnp.cross(forward, up))
    down = jnp.cross(forward, right)
    top = jnp.stack([right, down, forward, centre], axis=-1)
    return jnp.concatenate([top, jnp.array([[0, 0, 0, 1]], top.dtype)], axis=0)
