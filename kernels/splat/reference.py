"""Reference of `kernels.splat.blend` in plain JAX: every pixel looks at every Gaussian, in depth order, by `lax.scan`.

Slow and memory-hungry in reverse mode, exact and readable: the oracle of the tests, and the fallback that a user may
choose by name where Warp has no back end.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from kernels.splat.projection import ALPHA_MIN, RULES, TILE, Shape, Splats, project, require_one_float, usable


def blend(
    splats: Splats,
    colour: Float[Array, "gaussian 3"],
    background: Float[Array, "3"],
    *,
    width: int,
    height: int,
    rules: str = "inria",
) -> tuple[Float[Array, "height width 3"], Float[Array, "height width"], Float[Array, "height width"]]:
    """Front-to-back alpha blending of screen-space splats; same meaning as `kernels.splat.blend.blend`."""
    require_one_float(centre=splats.centre, colour=colour)
    alpha_max, stop = RULES[rules].alpha_max, RULES[rules].stop(jnp.dtype(colour.dtype))
    order = jnp.argsort(splats.depth, stable=True)
    v, u = jnp.meshgrid(jnp.arange(height, dtype=colour.dtype), jnp.arange(width, dtype=colour.dtype), indexing="ij")
    tiles = (jnp.arange(side, dtype=jnp.int32) // TILE for side in (height, width))
    row, column = jnp.meshgrid(*tiles, indexing="ij")

    def step(state, gaussian):
        transmittance, image, depth, ended = state
        splat, rgb = gaussian
        x0, y0, x1, y1 = splat.rectangle
        dx, dy = splat.centre[0] - (u + 0.5), splat.centre[1] - (v + 0.5)
        A, B, C = splat.conic
        power = -0.5 * (A * dx * dx + C * dy * dy) - B * dx * dy
        seen = (column >= x0) & (column < x1) & (row >= y0) & (row < y1) & (power <= 0) & ~ended
        raw = splat.opacity * jnp.exp(jnp.where(seen, power, 0))
        seen = seen & (raw >= ALPHA_MIN)
        alpha = jnp.where(seen, jnp.where(raw > alpha_max, alpha_max, raw), 0)
        left = transmittance * (1 - alpha)
        ended = ended | (seen & (left < stop))
        weight = jnp.where(ended, 0, alpha * transmittance)
        image = image + weight[..., None] * rgb[None, None]
        return (jnp.where(ended, transmittance, left), image, depth + weight * splat.depth, ended), None

    zero = jnp.zeros((height, width), colour.dtype)
    start = (zero + 1, jnp.zeros((height, width, 3), colour.dtype), zero, jnp.zeros((height, width), bool))
    ordered = jax.tree.map(lambda x: x[order], (splats, colour))
    (transmittance, image, depth, _), _ = jax.lax.scan(step, start, ordered)
    return image + transmittance[..., None] * background.astype(colour.dtype)[None, None], depth, 1 - transmittance


def splat(
    mean: Float[Array, "gaussian 3"],
    quaternion: Float[Array, "gaussian 4"],
    scale: Float[Array, "gaussian 3"],
    opacity: Float[Array, "gaussian"],
    colour: Float[Array, "gaussian 3"],
    K: Float[Array, "3 3"],
    camera_from_world: Float[Array, "4 4"],
    background: Float[Array, "3"],
    *,
    shape: Shape,
) -> tuple[Float[Array, "height width 3"], Float[Array, "height width"], Float[Array, "height width"], Int[Array, ""]]:
    """Draw 3D Gaussians in plain JAX; same arguments, results and gradients as `kernels.splat.blend.splat`."""
    attributes = {"mean": mean, "quaternion": quaternion, "scale": scale, "opacity": opacity, "colour": colour}
    require_one_float(**attributes, K=K, camera_from_world=camera_from_world)
    finite = usable(mean, quaternion, scale, opacity, colour)
    splats = project(mean, quaternion, scale, opacity, K, camera_from_world, finite, shape)
    colour = jnp.where(finite[:, None], colour, 0)
    images = blend(splats, colour, background, width=shape.width, height=shape.height, rules=shape.rules)
    return (*images, jnp.sum(~finite))
