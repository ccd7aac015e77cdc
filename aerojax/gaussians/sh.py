"""Real spherical harmonics of degree 0 to 3 as used for the colour of Gaussians, and their rotation.

Order and signs are those of the 3D-Gaussian-splatting files (Kerbl et al. 2023; Sloan 2008, "Stupid Spherical Harmonics
Tricks", Appendix A2, with the Condon-Shortley sign): degree by degree, m from -l to l.
"""

from __future__ import annotations

import functools

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from aerojax.core.errors import UserError

COEFFICIENTS = (1, 4, 9, 16)
"""How many coefficients the degrees 0, 1, 2 and 3 have."""


def degree_of(coefficients: int) -> int:
    """Degree of a set of coefficients.

    Raises:
        UserError: if the number is not 1, 4, 9 or 16.
    """
    if coefficients not in COEFFICIENTS:
        raise UserError(
            "invalid", f"sh: {coefficients} coefficients a channel", "supported are 1, 4, 9 and 16 (degree 0 to 3)"
        )
    return COEFFICIENTS.index(coefficients)


def basis(direction: Float[Array, "*batch 3"], degree: int) -> Float[Array, "*batch coefficient"]:
    """Values Y_k of all harmonics up to `degree` in unit directions."""
    return _basis(direction, degree, jnp)


def _basis(direction, degree: int, xp):
    x, y, z = direction[..., 0], direction[..., 1], direction[..., 2]
    values = [xp.full_like(x, 0.28209479177387814)]  # sqrt(1/4π)
    if degree >= 1:
        c = 0.4886025119029199  # sqrt(3/4π)
        values += [-c * y, c * z, -c * x]
    xx, yy, zz = x * x, y * y, z * z
    if degree >= 2:
        c, c0, c2 = 1.0925484305920792, 0.31539156525252005, 0.5462742152960396  # sqrt(15/4π), sqrt(5/16π), c/2
        values += [c * x * y, -c * y * z, c0 * (2 * zz - xx - yy), -c * x * z, c2 * (xx - yy)]
    if degree >= 3:
        c3, c2, c1, c0 = 0.5900435899266435, 2.890611442640554, 0.4570457994644658, 0.3731763325901154
        values += [
            -c3 * y * (3 * xx - yy),
            c2 * x * y * z,
            -c1 * y * (4 * zz - xx - yy),
            c0 * z * (2 * zz - 3 * xx - 3 * yy),
            -c1 * x * (4 * zz - xx - yy),
            c2 / 2 * z * (xx - yy),
            -c3 * x * (xx - 3 * yy),
        ]
    return xp.stack(values, axis=-1)


def colour_in_direction(
    sh: Float[Array, "*batch coefficient 3"], direction: Float[Array, "*batch 3"]
) -> Float[Array, "*batch 3"]:
    """RGB seen along unit directions (from the camera to the Gaussian): max(0, Σ c_k Y_k + 0.5).

    The offset makes zero coefficients grey; the gradient is zero where a channel is clamped.
    """
    values = basis(direction, degree_of(sh.shape[-2]))
    return jnp.maximum(jnp.einsum("...k,...kc->...c", values, sh) + 0.5, 0.0)


@functools.cache
def _sample_directions(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Well-spread unit directions (rows) and the pseudo-inverse of the harmonics of exactly `degree` on them."""
    index = np.arange(32) + 0.5
    z, azimuth = 1 - index / 16, np.pi * (1 + 5**0.5) * index  # the Fibonacci lattice of Swinbank & Purser 2006
    radius = np.sqrt(1 - z * z)
    directions = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=-1)
    return directions, np.linalg.pinv(_basis(directions, degree, np)[:, degree**2 :])


def rotation_of_degree(rotation: Float[Array, "3 3"], degree: int) -> Float[Array, "order order"]:
    """The orthogonal matrix D with Y_l(R d) = D Y_l(d) for the harmonics of exactly `degree`.

    They span a space that rotations map to itself, so the least-squares fit on a fixed set of directions is exact.
    """
    directions, inverse = _sample_directions(degree)
    rotated = jnp.asarray(directions, rotation.dtype) @ rotation.T
    values = basis(rotated, degree)[:, degree**2 :]
    return (jnp.asarray(inverse, rotation.dtype) @ values).T


def rotate_sh(sh: Float[Array, "*batch coefficient 3"], rotation: Float[Array, "3 3"]) -> Float[Array, "*batch k 3"]:
    """Coefficients of the rotated colour function: f_rotated(R d) = f(d) in every direction d."""
    parts = [sh[..., :1, :]]
    for degree in range(1, degree_of(sh.shape[-2]) + 1):
        matrix = rotation_of_degree(rotation, degree)
        parts.append(jnp.einsum("jk,...kc->...jc", matrix, sh[..., degree**2 : (degree + 1) ** 2, :]))
    return jnp.concatenate(parts, axis=-2)
