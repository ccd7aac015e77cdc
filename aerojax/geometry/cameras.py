"""Pinhole cameras: projection, back-projection and rigid transforms. OpenCV axes, pixel centres at +0.5.

All functions take NumPy arrays (float64 on the host, where truth is measured and files are made) or JAX arrays (within
transformations) and compute where their points are; `project_points` is the only pinhole projection.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from jaxtyping import Float

from aerojax.core.arrays import AnyArray, namespace
from aerojax.geometry.rotations import normalise

BEHIND = 1e-6
"""Metres: what is nearer to the camera's plane than this, or behind it, has no pixel."""


@runtime_checkable
class Intrinsics(Protocol):
    """Whatever has a pinhole's K: pixels, 3×3; the centre of the top-left pixel is (0.5, 0.5)."""

    @property
    def K(self) -> Any:
        """Intrinsics."""
        ...


@runtime_checkable
class Pinhole(Intrinsics, Protocol):
    """Whatever has the numbers of a pinhole camera: `core.types.Camera`, `capture.format.CaptureCamera`.

    world_from_cam: rigid transform, metres, 4×4.
    """

    @property
    def world_from_cam(self) -> Any:
        """Pose."""
        ...


def invert_rigid(transform: Float[AnyArray, "*batch 4 4"]) -> Float[AnyArray, "*batch 4 4"]:
    """Inverse of a rigid transform [R t; 0 1]: [Rᵀ -Rᵀt; 0 1]."""
    xp = namespace(transform)
    rotation = xp.swapaxes(transform[..., :3, :3], -1, -2)
    translation = -rotation @ transform[..., :3, 3:]
    top = xp.concatenate([rotation, translation], axis=-1)
    return xp.concatenate([top, transform[..., 3:, :]], axis=-2)


def transform_points(
    transform: Float[AnyArray, "4 4"], points: Float[AnyArray, "*batch 3"]
) -> Float[AnyArray, "*batch 3"]:
    """Apply a rigid transform `dst_from_src` to points in the source frame, metres."""
    return points @ transform[:3, :3].T + _like(transform[:3, 3], points)


def points_in_camera(points_world: Float[AnyArray, "*batch 3"], camera: Pinhole) -> Float[AnyArray, "*batch 3"]:
    """World points in the camera's frame, metres; z is the depth along the optical axis."""
    rotation, centre = camera.world_from_cam[:3, :3], camera.world_from_cam[:3, 3]
    return (points_world - _like(centre, points_world)) @ rotation


def _like(vector: Any, points: Float[AnyArray, "*batch n"]) -> Float[AnyArray, "*batch n"]:
    """A vector for each point; JAX does not guess ranks here."""
    return namespace(points).broadcast_to(vector, points.shape)


def pixels_of_camera_points(points: Float[AnyArray, "*batch 3"], camera: Intrinsics) -> Float[AnyArray, "*batch 2"]:
    """Project points of the camera's own frame: u = fx·X/Z + skew·Y/Z + cx, v = fy·Y/Z + cy.

    For callers that need the depth as well, or want to bound it first; else see `project_points`.
    """
    xp = namespace(points)
    z = points[..., 2:]
    safe = xp.where(xp.abs(z) < 1e-9, 1e-9, z)
    # Element by element: a product of matrices may run in less than float32 on a GPU.
    slopes, K = points[..., :2] / safe, camera.K
    straight = slopes * _like(xp.diagonal(K)[:2], slopes) + _like(K[:2, 2], slopes)
    return straight + _like(K[0, 1] * xp.eye(2, dtype=straight.dtype)[0], slopes) * slopes[..., 1:]


def project_points(
    points_world: Float[AnyArray, "*batch 3"], camera: Pinhole, *, behind: float | None = None
) -> Float[AnyArray, "*batch 2"]:
    """Project world points to pixels with a pinhole camera.

    u = fx·X/Z + skew·Y/Z + cx, v = fy·Y/Z + cy (thesis Eq. 3.1; Hartley & Zisserman 2004, §6.1).

    Args:
        points_world: positions, metres, world frame.
        camera: one OpenCV camera; use `jax.vmap` for many.
        behind: both coordinates of points that are less than `BEHIND` in front of the camera, such as NaN; None leaves
            there what the formula gives, which means nothing.

    Returns:
        Pixel coordinates (u right, v down). Not clipped to the image.
    """
    inside = points_in_camera(points_world, camera)
    pixels = pixels_of_camera_points(inside, camera)
    if behind is None:
        return pixels
    return namespace(pixels).where(inside[..., 2:] > BEHIND, pixels, behind)


def pixel_rays(pixels: Float[AnyArray, "*batch 2"], camera: Pinhole) -> Float[AnyArray, "*batch 3"]:
    """Unit world-frame directions of the rays through pixels."""
    return normalise(_camera_rays(pixels, camera) @ camera.world_from_cam[:3, :3].T)


def unproject_depth(
    pixels: Float[AnyArray, "*batch 2"], depth: Float[AnyArray, "*batch"], camera: Pinhole
) -> Float[AnyArray, "*batch 3"]:
    """World points at depth z along the optical axis (metres) behind pixels; the inverse of `project_points`."""
    return transform_points(camera.world_from_cam, _camera_rays(pixels, camera) * depth[..., None])


def _camera_rays(pixels: Float[AnyArray, "*batch 2"], camera: Intrinsics) -> Float[AnyArray, "*batch 3"]:
    """Points of the camera's frame at depth 1 behind pixels."""
    xp = namespace(pixels)
    ones = xp.ones((*pixels.shape[:-1], 1), pixels.dtype)
    return xp.concatenate([pixels, ones], axis=-1) @ xp.linalg.inv(camera.K).T


def look_at(centre: Float[AnyArray, "3"], target: Float[AnyArray, "3"]) -> Float[AnyArray, "4 4"]:
    """`world_from_cam` of a camera at `centre` whose +z looks at `target`, with the image's up towards world +Z.

    Where it looks straight up or down (within 2.6°: |z| of the direction from 0.999), its up is towards +X.

    Args:
        centre, target: metres, world; not the same point.
    """
    xp = namespace(centre)
    forward = normalise(target - centre)
    up, other = xp.eye(3, dtype=forward.dtype)[2], xp.eye(3, dtype=forward.dtype)[0]
    right = normalise(xp.cross(forward, xp.where(xp.abs(forward[2]) < 0.999, up, other)))
    top = xp.stack([right, xp.cross(forward, right), forward, centre], axis=1)
    return xp.concatenate([top, xp.eye(4, dtype=top.dtype)[3:]], axis=0)
