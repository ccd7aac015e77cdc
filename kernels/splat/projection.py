"""From 3D Gaussians to screen-space splats in plain JAX: shared by the Warp kernel and its reference.

Dense and short, so XLA compiles it better than a loop would, and JAX differentiates it exactly, camera included.
Every decision (culling, the clamp of the Jacobian's ratios, radius, tile rectangle) is frozen: gradients are those of
the smooth formula inside one branch, without the shortcuts of published kernels (EWA splatting, Zwicker et al. 2001,
Eq. 29-33; Kerbl et al. 2023, §4).
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

TILE = 16
"""Edge of a square tile, pixels."""
DILATION = 0.3
"""Variance added to both image axes, square pixels: a low-pass of about one pixel."""
ALPHA_MIN = 1.0 / 255.0
"""Contributions below one 8-bit step are skipped."""
MIN_TRANSMITTANCE = 1e-4
"""A pixel ends before the Gaussian that would bring its transmittance below this."""
COMPENSATION_FLOOR = 0.005**2
"""Smallest determinant ratio of the anti-alias compensation: keeps the root's gradient finite at zero size."""
MAX_MAGNITUDE = 1e12
"""Inputs beyond this magnitude count as non-finite: their squares would overflow float32."""


class Rules(NamedTuple):
    """One published convention of the splat's borders.

    alpha_max: opacity clamp of one Gaussian at one pixel; the gradient through the clamp is zero.
    opacity_aware: extent from the opacity and per axis, else a square of three standard deviations of the long axis.
    centred_clamp: Jacobian ratios clamped symmetrically about the optical axis, else about the image rectangle.
    stop_at_equality: whether transmittance exactly `MIN_TRANSMITTANCE` ends the pixel.
    """

    alpha_max: float
    opacity_aware: bool
    centred_clamp: bool
    stop_at_equality: bool

    def stop(self, dtype: np.dtype) -> float:
        """The threshold t for which `T < t` expresses this rule's stop in `dtype`."""
        threshold = dtype.type(MIN_TRANSMITTANCE)
        return float(np.nextafter(threshold, dtype.type(1)) if self.stop_at_equality else threshold)


RULES = {
    "inria": Rules(alpha_max=0.99, opacity_aware=False, centred_clamp=True, stop_at_equality=False),
    "gsplat": Rules(alpha_max=0.999, opacity_aware=True, centred_clamp=False, stop_at_equality=True),
}
"""`inria`: Kerbl et al. 2023 as published; `gsplat`: Ye et al. 2024, version 1.5."""


class Splats(NamedTuple):
    """Gaussians on the image plane, ready for tiling.

    centre: pixels, centre of the top-left pixel at (0.5, 0.5).
    conic: A, B, C of the inverse covariance [[A, B], [B, C]], per square pixel.
    depth: z along the optical axis, metres.
    opacity: 0..1, anti-alias compensation included.
    rectangle: tiles x0, y0, x1, y1 (upper bounds exclusive); all zero where the Gaussian is not drawn.
    """

    centre: Float[Array, "gaussian 2"]
    conic: Float[Array, "gaussian 3"]
    depth: Float[Array, "gaussian"]
    opacity: Float[Array, "gaussian"]
    rectangle: Int[Array, "gaussian 4"]


class Shape(NamedTuple):
    """What is static about a projection: image size in pixels, near plane in metres, rules by name, anti-aliasing."""

    width: int
    height: int
    near: float
    rules: str
    antialias: bool


def require_one_float(**arrays: Array) -> None:
    """Refuse arrays that are not all float32 or all float64, the types that the kernels are compiled for.

    Raises:
        TypeError: names each array and its type.
    """
    kinds = {name: str(array.dtype) for name, array in arrays.items()}
    if len(set(kinds.values())) > 1 or not set(kinds.values()) <= {"float32", "float64"}:
        found = ", ".join(f"{name} {kind}" for name, kind in kinds.items())
        raise TypeError(f"the splatter computes in float32 or in float64, all arrays in the same; got {found}")


def rotation_of(quaternion: Float[Array, "gaussian 4"]) -> Float[Array, "gaussian 3 3"]:
    """Rotation matrices of (w, x, y, z), normalised first; the zero quaternion gives the identity."""
    square = jnp.sum(quaternion * quaternion, axis=-1, keepdims=True)
    w, x, y, z = jnp.moveaxis(quaternion * jax.lax.rsqrt(jnp.maximum(square, 1e-24)), -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def usable(
    mean: Float[Array, "gaussian 3"],
    quaternion: Float[Array, "gaussian 4"],
    scale: Float[Array, "gaussian 3"],
    opacity: Float[Array, "gaussian"],
    colour: Float[Array, "gaussian 3"],
) -> Bool[Array, "gaussian"]:
    """Which Gaussians have only finite attributes of sane magnitude; the others are dropped and counted."""
    columns = jnp.concatenate([mean, quaternion, scale, opacity[:, None], colour], axis=-1)
    return jnp.all(jnp.isfinite(columns) & (jnp.abs(columns) <= MAX_MAGNITUDE), axis=-1)


def zero_rows(arrays: tuple[Array, ...], keep: Bool[Array, "gaussian"]) -> tuple[Array, ...]:
    """Arrays over Gaussians with zeros where `keep` is false; zeros also stop the gradient there."""
    return tuple(jnp.where(keep.reshape(-1, *[1] * (x.ndim - 1)), x, 0) for x in arrays)


def _ratio_limits(K: Float[Array, "3 3"], axis: int, size: int, rules: Rules) -> tuple[Array, Array]:
    """Bounds of X/Z (axis 0) or Y/Z (axis 1): beyond 1.3 half fields of view the linearisation explodes."""
    focal, principal = K[axis, axis], K[axis, 2]
    half = size / (2 * focal)
    if rules.centred_clamp:
        return -1.3 * half, 1.3 * half
    return -(principal / focal + 0.3 * half), (size - principal) / focal + 0.3 * half


def _image_axes(
    t: Float[Array, "gaussian 3"], axes: Float[Array, "gaussian 3 3"], K: Float[Array, "3 3"], shape: Shape
) -> tuple[Array, Array]:
    """Rows of J·axes: the two image-plane rows (pixels) of the Gaussian's principal half-axes in the camera frame."""
    rows = []
    for axis, size in ((0, shape.width), (1, shape.height)):
        lowest, highest = _ratio_limits(K, axis, size, RULES[shape.rules])
        ratio = jnp.clip(t[:, axis] / t[:, 2], lowest, highest)
        rows.append(K[axis, axis] / t[:, 2:] * (axes[:, axis] - ratio[:, None] * axes[:, 2]))
    return rows[0], rows[1]


def _rectangle(
    centre: Float[Array, "gaussian 2"], covariance: tuple[Array, Array, Array], opacity: Array, shape: Shape
) -> Int[Array, "gaussian 4"]:
    """Tiles that a splat may touch under the rules' extent."""
    a, b, c = covariance
    tiles = jnp.array([[-(-shape.width // TILE), -(-shape.height // TILE)]], centre.dtype)
    if RULES[shape.rules].opacity_aware:
        sigmas = jnp.sqrt(2 * jnp.log(jnp.maximum(opacity / ALPHA_MIN, 1.0)))
        radius = jnp.ceil(jnp.minimum(3.33, sigmas)[:, None] * jnp.sqrt(jnp.stack([a, c], axis=-1)))
        low, high = jnp.floor((centre - radius) / TILE), jnp.ceil((centre + radius) / TILE)
        high = jnp.where((opacity >= ALPHA_MIN)[:, None], high, low)
    else:
        # Eigenvalues of the covariance; the floor of 0.1 is part of the published rule.
        spread = jnp.sqrt(jnp.maximum(0.1, ((a - c) / 2) ** 2 + b * b))
        radius = jnp.ceil(3 * jnp.sqrt((a + c) / 2 + spread))[:, None]
        corner = centre - 0.5
        low, high = jnp.floor((corner - radius) / TILE), jnp.floor((corner + radius + TILE - 1) / TILE)
    return jnp.concatenate([jnp.clip(low, 0, tiles), jnp.clip(high, 0, tiles)], axis=-1).astype(jnp.int32)


def _project(gaussians: tuple[Array, ...], K: Array, world: Array, keep: Array, shape: Shape) -> Splats:
    """The projection of the Gaussians in `keep`; the others become a harmless splat that nothing may see."""
    mean, quaternion, scale, opacity = gaussians
    ahead = jnp.array([[0, 0, 1]], mean.dtype)
    t = jnp.where(keep[:, None], mean @ world[:3, :3].T + world[None, :3, 3], ahead)
    axes = world[:3, :3] @ (rotation_of(quaternion) * scale[:, None, :])
    row_u, row_v = _image_axes(t, axes, K, shape)
    a = jnp.sum(row_u * row_u, axis=-1) + DILATION
    b = jnp.sum(row_u * row_v, axis=-1)
    c = jnp.sum(row_v * row_v, axis=-1) + DILATION
    # |row_u × row_v|² is the undilated determinant (Lagrange); a sum of positive terms, where ac - b² would cancel.
    undilated = jnp.sum(jnp.cross(row_u, row_v) ** 2, axis=-1)
    determinant = undilated + DILATION * (a + c) - DILATION**2
    if shape.antialias:
        opacity = opacity * jnp.sqrt(jnp.maximum(undilated / determinant, COMPENSATION_FLOOR))
    centre = t[:, :2] / t[:, 2:] * jnp.stack([K[0, 0], K[1, 1]])[None] + K[None, :2, 2]
    rectangle = _rectangle(*jax.lax.stop_gradient((centre, (a, b, c), opacity)), shape)
    conic = jnp.stack([c, -b, a], axis=-1) / determinant[:, None]
    return Splats(centre, conic, t[:, 2], opacity, rectangle)


@functools.partial(jax.jit, static_argnames="shape")
def _drawn(gaussians: tuple[Array, ...], K: Array, world: Array, keep: Array, shape: Shape) -> Bool[Array, "gaussian"]:
    """Which Gaussians in `keep` are in front of the near plane, touch a tile and project to finite numbers."""
    in_front = gaussians[0] @ world[2, :3] + world[2, 3] > shape.near
    camera_is_finite = jnp.all(jnp.isfinite(K)) & jnp.all(jnp.isfinite(world))
    keep = keep & in_front & camera_is_finite
    splats = _project(gaussians, K, world, keep, shape)
    numbers = jnp.concatenate([splats.centre, splats.conic, splats.depth[:, None], splats.opacity[:, None]], axis=-1)
    positive = splats.conic[:, 0] * splats.conic[:, 2] > splats.conic[:, 1] ** 2
    touches = jnp.all(splats.rectangle[:, 2:] > splats.rectangle[:, :2], axis=-1)
    return keep & jnp.all(jnp.isfinite(numbers), axis=-1) & positive & touches


def project(
    mean: Float[Array, "gaussian 3"],
    quaternion: Float[Array, "gaussian 4"],
    scale: Float[Array, "gaussian 3"],
    opacity: Float[Array, "gaussian"],
    K: Float[Array, "3 3"],
    camera_from_world: Float[Array, "4 4"],
    finite: Bool[Array, "gaussian"],
    shape: Shape,
) -> Splats:
    """Project Gaussians to screen-space splats.

    Two passes: the first, without gradient, decides what is drawn; the second replaces what is not drawn by constants
    *before* the arithmetic, so that neither values nor gradients can become NaN (0·∞ in a masked branch would).

    Args:
        mean: centres, metres, world frame.
        quaternion: w, x, y, z; normalised here.
        scale: standard deviations, metres.
        opacity: 0..1.
        K: pinhole intrinsics, pixels, no skew.
        camera_from_world: rigid transform to OpenCV camera axes; its twelve entries have independent gradients.
        finite: mask from `usable`.
        shape: static settings.
    """
    finite = jax.lax.stop_gradient(finite)
    gaussians = zero_rows((mean, quaternion, scale, opacity), finite)
    drawn = _drawn(*jax.lax.stop_gradient((gaussians, K, camera_from_world)), finite, shape=shape)
    gaussians = zero_rows(gaussians, drawn)
    camera_is_finite = jnp.all(jnp.isfinite(K)) & jnp.all(jnp.isfinite(camera_from_world))
    K = jnp.where(camera_is_finite, K, jnp.eye(3, dtype=K.dtype))
    camera_from_world = jnp.where(camera_is_finite, camera_from_world, jnp.eye(4, dtype=K.dtype))
    splats = _project(gaussians, K, camera_from_world, drawn, shape)
    return splats._replace(rectangle=jnp.where(drawn[:, None], splats.rectangle, 0))
