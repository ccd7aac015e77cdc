"""Rotations as 3×3 matrices and as unit quaternions (w, x, y, z). `q` and `-q` are the same rotation."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key

from aerojax.core.arrays import AnyArray


def normalise(vector: Float[AnyArray, "*batch axis"], *, eps: float = 1e-12) -> Float[AnyArray, "*batch axis"]:
    """Unit vector along the last axis, NumPy or JAX; the zero vector stays zero and its gradient finite."""
    if isinstance(vector, np.ndarray):
        return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), eps)
    square = jnp.sum(vector * vector, axis=-1, keepdims=True)
    return vector * jax.lax.rsqrt(jnp.maximum(square, eps * eps))


def rotation_from_quaternion(quaternion: Float[Array, "*batch 4"]) -> Float[Array, "*batch 3 3"]:
    """Rotation matrix of a quaternion (w, x, y, z), normalised first (Shoemake 1985).

    Args:
        quaternion: any non-zero quaternion; the zero quaternion gives the identity.
    """
    w, x, y, z = jnp.moveaxis(normalise(quaternion), -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_rotation(rotation: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch 4"]:
    """Unit quaternion with w ≥ 0 of a rotation matrix (Shepperd 1978: divide by the largest component).

    Args:
        rotation: orthonormal with determinant 1; not checked.
    """
    m = rotation
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    # Four times the square of each component; the largest is at least one, so its root is safe.
    squares = jnp.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz], axis=-1)
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 1, 0] + m[..., 0, 1], m[..., 0, 2] + m[..., 2, 0], m[..., 2, 1] + m[..., 1, 2]
    candidates = jnp.stack(
        [
            jnp.stack([squares[..., 0], wx, wy, wz], axis=-1),
            jnp.stack([wx, squares[..., 1], xy, xz], axis=-1),
            jnp.stack([wy, xy, squares[..., 2], yz], axis=-1),
            jnp.stack([wz, xz, yz, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    best = jnp.argmax(squares, axis=-1)
    q = jnp.take_along_axis(candidates, best[..., None, None], axis=-2)[..., 0, :]
    return canonical_sign(normalise(q))


def canonical_sign(quaternion: Float[Array, "*batch 4"]) -> Float[Array, "*batch 4"]:
    """The representative with w ≥ 0 (w = 0 keeps its sign: sign(0) = +1, so nothing becomes the zero quaternion)."""
    return jnp.where(quaternion[..., :1] < 0, -quaternion, quaternion)


def quaternion_multiply(a: Float[Array, "*batch 4"], b: Float[Array, "*batch 4"]) -> Float[Array, "*batch 4"]:
    """Hamilton product a ⊗ b: the rotation `b` followed by `a`."""
    aw, ax, ay, az = jnp.moveaxis(a, -1, 0)
    bw, bx, by, bz = jnp.moveaxis(b, -1, 0)
    product = (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
    return jnp.stack(product, axis=-1)


def haar_quaternion(*, key: Key[Array, ""]) -> Float[Array, "4"]:
    """A uniform random unit quaternion: a normalised 4-D Gaussian (Muller 1959), w ≥ 0."""
    return canonical_sign(normalise(jax.random.normal(key, (4,))))


def haar_rotation(*, key: Key[Array, ""]) -> Float[Array, "3 3"]:
    """A random rotation from the Haar measure of SO(3)."""
    return rotation_from_quaternion(haar_quaternion(key=key))


def rotation_about_z(angle: Float[Array, "*batch"]) -> Float[Array, "*batch 3 3"]:
    """Rotation by `angle` radians about +Z (up)."""
    c, s, zero, one = jnp.cos(angle), jnp.sin(angle), jnp.zeros_like(angle), jnp.ones_like(angle)
    rows = ((c, -s, zero), (s, c, zero), (zero, zero, one))
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def skew(vector: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """The matrix [v]× with [v]× u = v × u."""
    x, y, z = jnp.moveaxis(vector, -1, 0)
    o = jnp.zeros_like(x)
    rows = ((o, -z, y), (z, o, -x), (-y, x, o))
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def rotation_between(source: Float[Array, "*batch 3"], target: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """The minimal rotation that takes unit vector `source` to unit vector `target` (Rodrigues).

    R = I + [v]× + [v]×²/(1+c), v = source × target, c = source·target. Undefined for opposite vectors, where the
    axis is arbitrary; the division is kept finite there.
    """
    v = jnp.cross(source, target)
    c = jnp.sum(source * target, axis=-1)[..., None, None]
    k = skew(v)
    return jnp.broadcast_to(jnp.eye(3, dtype=k.dtype), k.shape) + k + k @ k / jnp.maximum(1 + c, 1e-9)
