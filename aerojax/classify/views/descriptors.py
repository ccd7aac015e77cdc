"""Closed-form descriptors of a silhouette that a camera's roll, distance and zoom leave unchanged.

Aspect, fill, isoperimetric ratio, magnitudes of complex moments (Flusser, Suk & Zitová 2009, Ch. 2) and magnitudes of
the angular Fourier coefficients of its polar image. All up to the interpolation of the images; none is learned.
"""

from __future__ import annotations

import math

import jax.numpy as jnp
from jaxtyping import Array, Float

from aerojax.classify.views.polar import PIXEL_VARIANCE, Moments, fourier_magnitudes, pixel_centres

OUTLINE_DESCRIPTORS = 9
_FAINT = 0.05
"""Magnitude at which the logarithm of Fourier magnitudes bends from linear: a twentieth of full coverage."""
_ORDERS = ((2, 1), (3, 0), (2, 2), (3, 1), (4, 0))
"""p, q of the complex moments Σ c·z^p·z̄^q that are read."""


def descriptor_count(radii: int, harmonics: int) -> int:
    """How many numbers `silhouette_descriptors` gives."""
    return OUTLINE_DESCRIPTORS + radii * (harmonics + 1)


def silhouette_descriptors(
    coverage: Float[Array, "size size"], about: Moments, polar: Float[Array, "radius angle"], harmonics: int
) -> Float[Array, "descriptor"]:
    """Those of the outline, then log(1 + |F_k(r)|/0.05) for k = 0..harmonics at each radius."""
    magnitudes = fourier_magnitudes(polar.T, 0, harmonics)
    return jnp.concatenate([outline_descriptors(coverage, about), jnp.log1p(magnitudes / _FAINT).ravel()])


def outline_descriptors(coverage: Float[Array, "size size"], about: Moments) -> Float[Array, "9"]:
    """Numbers of the whole outline.

    With covariance eigenvalues a ≥ b, area A and perimeter P: ½log(a/b), log A/(4π√(ab)) and log A/(2π(a+b)), which are
    0 for an ellipse and a disc, log P²/(4πA), and log(1+|c_pq|/(A·r^(p+q))) for (2,1), (3,0), (2,2), (3,1), (4,0).
    """
    area = jnp.maximum(about.area, 1e-3)
    spread = jnp.sqrt(about.difference**2 + about.product**2 + 1e-9)
    large = 0.5 * (about.trace + spread)
    small = jnp.maximum(0.5 * (about.trace - spread), PIXEL_VARIANCE)
    numbers = [
        0.5 * jnp.log(large / small),
        jnp.log(area / (4 * math.pi * jnp.sqrt(large * small))),
        jnp.log(area / (2 * math.pi * about.trace)),
        jnp.log(perimeter(coverage) ** 2 / (4 * math.pi * area) + 1e-3),
    ]
    return jnp.concatenate([jnp.stack(numbers), complex_moments(coverage, about)])


def perimeter(coverage: Float[Array, "size size"]) -> Float[Array, ""]:
    """Length of the outline, pixels: total variation of the coverage (coarea formula)."""
    padded = jnp.pad(coverage, 1)
    main, other = padded[1:, 1:] - padded[:-1, :-1], padded[1:, :-1] - padded[:-1, 1:]
    # Along both diagonals of each four pixels, so that a quarter turn changes nothing.
    return jnp.sum(jnp.sqrt(0.5 * (main**2 + other**2) + 1e-12))


def complex_moments(coverage: Float[Array, "size size"], about: Moments) -> Float[Array, "5"]:
    """log(1 + |Σ c·z^p·z̄^q|/A) of the orders that are read, z from the centre in units of the radius."""
    at = jnp.asarray(pixel_centres(coverage.shape[0]), coverage.dtype)
    x = jnp.broadcast_to(((at - about.centre[0]) / about.radius)[None, :], coverage.shape)
    y = jnp.broadcast_to(((at - about.centre[1]) / about.radius)[:, None], coverage.shape)
    share = coverage / jnp.maximum(about.area, 1e-3)
    square = x * x + y * y
    powers = [(x, y)]
    for _ in range(3):
        u, v = powers[-1]
        powers.append((u * x - v * y, u * y + v * x))
    found = []
    for p, q in _ORDERS:
        weight = share * square**q
        if p == q:
            found.append(weight.sum())
        else:
            u, v = powers[p - q - 1]
            found.append(jnp.sqrt(jnp.sum(weight * u) ** 2 + jnp.sum(weight * v) ** 2 + 1e-9))
    return jnp.log1p(jnp.stack(found))
