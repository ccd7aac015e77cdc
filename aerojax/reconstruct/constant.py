"""Every view's pixels as Gaussians in one plane through the object: what a reconstructor without depth makes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from aerojax.core.errors import UserError
from aerojax.core.types import SH_C0, Camera, Gaussians, View, pytree_dataclass, static_field
from aerojax.geometry.cameras import unproject_depth
from aerojax.reconstruct.base import ReconstructorConfig
from aerojax.reconstruct.packing import visible_first


@dataclass(frozen=True)
class ConstantConfig(ReconstructorConfig):
    """Pixels become Gaussians in squares.

    square: pixels along the side of one.
    spread: standard deviation over the side of a square at the object.
    """

    name: Literal["constant"] = "constant"
    square: int = 2
    spread: float = 0.5

    def __post_init__(self) -> None:
        if self.square < 1:
            raise UserError("out-of-range", f"constant: square is {self.square}", "use 1 or more")

    def build(self) -> Constant:
        """The member."""
        return Constant(self)


@pytree_dataclass
class Constant:
    """The member of the door; a pytree without leaves."""

    config: ConstantConfig = static_field()

    def __call__(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, Int[Array, ""]]:
        """See `Reconstructor`; a side that the squares do not divide loses its last pixels."""
        each = jax.vmap(lambda view, use: _in_plane(view, use, self.config))(views, valid)
        return visible_first(jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:]), each))


def _in_plane(view: View, use: Bool[Array, ""], config: ConstantConfig) -> Gaussians:
    square = config.square
    rows, columns = (side // square for side in view.mask.shape)

    def mean(values: Float[Array, "height width channel"]) -> Float[Array, "gaussian channel"]:
        cut = values[: rows * square, : columns * square]
        return cut.reshape(rows, square, columns, square, -1).mean(axis=(1, 3)).reshape(rows * columns, -1)

    coverage = mean(view.mask[..., None])
    colour = mean(view.rgb * view.mask[..., None]) / jnp.maximum(coverage, 1e-6)
    at = (jnp.arange(max(rows, columns), dtype=view.rgb.dtype) + 0.5) * square
    pixels = jnp.stack(jnp.meshgrid(at[:columns], at[:rows], indexing="xy"), axis=-1).reshape(-1, 2)
    camera = Camera(view.camera.K, view.camera.world_from_cam, view.camera.width, view.camera.height)
    distance = jnp.linalg.norm(camera.world_from_cam[:3, 3])
    side = square * distance / camera.K[0, 0]
    opacity = jnp.where(use, coverage[:, 0], 0.0)
    return Gaussians(
        mean=unproject_depth(pixels, jnp.broadcast_to(distance, pixels.shape[:1]), camera),
        quaternion=jnp.broadcast_to(jnp.eye(4)[0], (len(pixels), 4)),
        scale=jnp.broadcast_to(config.spread * side, (len(pixels), 3)),
        opacity=jnp.minimum(opacity, 0.99),
        sh=((colour - 0.5) / SH_C0)[:, None, :],
    )
