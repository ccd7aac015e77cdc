"""Maps between grids of cells: where a cell lies in the image, and resampling from one grid to another.

All grids of strided convolutions with odd sides begin at the first pixel: cell i of a grid with cells of s pixels has
its centre on pixel s·i, at s·i + ½ in continuous pixels. Resampling from cells of a to cells of b pixels therefore
reads position i·b/a. Upstream stretches grids corner to corner instead (`align_corners`), up to 3 pixels off.
"""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

BICUBIC = -0.75
"""Slope parameter a of Keys' cubic kernel (1981) as PyTorch sets it."""
POSITION_OFFSET = 0.1
"""DINOv2 adds it to the number of patches before it takes the ratio of two grids."""


def resize(
    x: Float[Array, "view height width channel"], cells: int, *, compat: bool
) -> Float[Array, "view cells cells channel"]:
    """Bilinear resampling of a square grid that covers the whole image to one of `cells`² cells.

    Args:
        x: cells with their centres on the first of their pixels.
        cells: along each side of the result.
        compat: corner to corner.
    """
    have = x.shape[1]
    step = (have - 1) / (cells - 1) if compat else have / cells
    return _resample(x, step * np.arange(cells))


def resize_areas(
    x: Float[Array, "view height width channel"], cells: int, *, compat: bool
) -> Float[Array, "view cells cells channel"]:
    """As `resize`, of an image or from one, where both grids' cells have their centres amidst their pixels."""
    have = x.shape[1]
    centres = (np.arange(cells) + 0.5) * have / cells - 0.5
    return _resample(x, (have - 1) / (cells - 1) * np.arange(cells) if compat else centres)


def resize_patches(
    x: Float[Array, "view height width channel"], cells: int, *, size: int, compat: bool
) -> Float[Array, "view cells cells channel"]:
    """As `resize`, from patches, whose centres lie amidst their pixels, to cells with centres on their first one.

    Args:
        size: of the image, pixels.
    """
    have = x.shape[1]
    centres = (np.arange(cells) * (size / cells) + 0.5) * have / size - 0.5
    return _resample(x, (have - 1) / (cells - 1) * np.arange(cells) if compat else centres)


def repeat(x: Float[Array, "view height width channel"], times: int) -> Float[Array, "view rows columns channel"]:
    """Every cell `times` × `times` times."""
    return jnp.repeat(jnp.repeat(x, times, axis=1), times, axis=2)


# A compiled part of its own, so that `cost.operations` can tell it from the network's matrix products.
@functools.partial(jax.jit, static_argnums=1)
def _resample_by(x: Array, weights: _Constant) -> Array:
    weight = jnp.asarray(weights.value, x.dtype)
    x = jnp.einsum("oi,viwc->vowc", weight, x, precision="highest")
    return jnp.einsum("oi,vhic->vhoc", weight, x, precision="highest")


class _Constant:
    """An array that can be a static argument."""

    def __init__(self, value: np.ndarray):
        self.value, self.key = value, value.tobytes()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Constant) and (self.value.shape, self.key) == (other.value.shape, other.key)

    def __hash__(self) -> int:
        return hash(self.key)


def _resample(x: Array, positions: np.ndarray) -> Array:
    """Both axes at the same positions; beyond the first and last cell their value."""
    have = x.shape[1]
    at = np.clip(positions, 0, have - 1)
    low = np.minimum(np.floor(at).astype(int), max(have - 2, 0))
    weights = np.zeros((len(at), have))
    rows = np.arange(len(at))
    np.add.at(weights, (rows, low), 1 - (at - low))
    np.add.at(weights, (rows, np.minimum(low + 1, have - 1)), at - low)
    return _resample_by(x, _Constant(weights.astype(np.float32)))


def resize_positions(
    table: Float[Array, "row column channel"], patches: int
) -> Float[Array, "patches patches channel"]:
    """A stored table of position embeddings for another number of patches (bicubic, DINOv2's rule).

    The ratio of the grids is (patches + 0.1)/stored, hence not quite that of the numbers of patches.
    """
    have = table.shape[0]
    if patches == have:
        return table
    ratio = (patches + POSITION_OFFSET) / have
    centres = (np.arange(patches) + 0.5) / ratio - 0.5
    base = np.floor(centres).astype(int)
    weights = np.zeros((patches, have))
    for tap in range(-1, 3):
        distance = np.abs(centres - (base + tap))
        np.add.at(weights, (np.arange(patches), np.clip(base + tap, 0, have - 1)), _keys(distance))
    return _resample_by(table[None], _Constant(weights.astype(np.float32)))[0]


def _keys(distance: np.ndarray) -> np.ndarray:
    """Keys' cubic kernel at distances up to 2 cells."""
    a, d = BICUBIC, distance
    near = (a + 2) * d**3 - (a + 3) * d**2 + 1
    far = a * (d**3 - 5 * d**2 + 8 * d - 4)
    return np.where(d <= 1, near, np.where(d < 2, far, 0.0))
