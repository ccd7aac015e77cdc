"""Differentiable EWA splatting of 3D Gaussians: projection in JAX, tiles and blending in Warp, on CPU and CUDA.

`jax.jit`, `jax.grad` (reverse mode), `jax.vmap` and `jax.lax.scan` work on it; any stack of `vmap`s becomes one launch
over all images. `kernels.splat.reference` has the same functions in plain JAX.
"""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import warp as wp
from jax.custom_batching import custom_vmap
from jaxtyping import Array, Float, Int

from kernels.splat.launch import callables
from kernels.splat.projection import ALPHA_MIN, RULES, Shape, Splats, project, require_one_float, usable
from kernels.splat.warp_kernels import GRADIENT

_MARGIN = 1e-3
"""A power this far under the exact visibility threshold is skipped before its exponential; rounding is far smaller."""


def _records(splats: Splats) -> Array:
    """The eight numbers a pixel needs of a Gaussian, in one cache line's half."""
    lowest = jnp.log(ALPHA_MIN / jnp.maximum(splats.opacity, 1e-30)) - _MARGIN
    columns = (splats.centre, splats.conic, splats.opacity[..., None], lowest[..., None], splats.depth[..., None])
    return jnp.concatenate(columns, axis=-1)


def _batched(function):
    """Let a function whose arguments and results all begin with an image axis absorb `vmap` into that axis."""
    wrapped = custom_vmap(function)

    @wrapped.def_vmap
    def rule(size, batched, *arguments):
        full = [
            x if is_batched else jnp.broadcast_to(x, (size, *x.shape))
            for x, is_batched in zip(arguments, batched, strict=True)
        ]
        flat = [x.reshape(-1, *x.shape[2:]) for x in full]
        results = wrapped(*flat)
        images = full[0].shape[1]
        results = jax.tree.map(lambda y: y.reshape(size, images, *y.shape[1:]), results)
        return results, jax.tree.map(lambda _: True, results)

    return wrapped


def _flat(x: Array) -> Array:
    return x.reshape(-1, *x.shape[2:])


@functools.cache
def _operations(width: int, height: int, rules: str, dtype: np.dtype):
    """Forward and backward of one configuration, batched over a leading image axis."""
    real = {np.dtype("float32"): wp.float32, np.dtype("float64"): wp.float64}[dtype]
    alpha_max, stop = RULES[rules].alpha_max, RULES[rules].stop(dtype)

    @_batched
    def forward(records, colours, depths, rectangles, backgrounds):
        images, pixels = backgrounds.shape[0], backgrounds.shape[0] * height * width
        flat = map(_flat, (records, colours, depths, rectangles))
        dims = dict.fromkeys(("image", "depth", "final", "last"), pixels)
        call = callables(real)[0]
        results = call(*flat, backgrounds, width, height, alpha_max, stop, output_dims=dims)
        return tuple(x.reshape(images, height, width, *x.shape[1:]) for x in results)

    @_batched
    def backward(records, colours, depths, rectangles, *pixels):
        images, gaussians = records.shape[:2]
        flat = [x.reshape(-1, *x.shape[3:]) for x in pixels]
        flat = [*map(_flat, (records, colours, depths, rectangles)), *flat]
        dims = {"out": images * gaussians}
        (gradient,) = callables(real)[1](*flat, images, width, height, alpha_max, output_dims=dims)
        return gradient.reshape(images, gaussians, GRADIENT)

    return forward, backward


@functools.partial(jax.custom_vjp, nondiff_argnums=(3, 4, 5))
def _blend(splats, colour, background, width, height, rules):
    return _blend_forward(splats, colour, background, width, height, rules)[0]


def _blend_forward(splats, colour, background, width, height, rules):
    forward, _ = _operations(width, height, rules, np.dtype(colour.dtype))
    inputs = (_records(splats), colour, splats.depth, splats.rectangle)
    image, depth, final, last = (x[0] for x in forward(*(x[None] for x in (*inputs, background))))
    return (image, depth, 1 - final), (inputs, background, final, last)


def _blend_backward(width, height, rules, saved, cotangents):
    inputs, background, final, last = saved
    g_image, g_depth, g_alpha = cotangents
    # The background and the alpha image depend on the splats only through the final transmittance.
    g_final = g_image @ background - g_alpha
    _, backward = _operations(width, height, rules, np.dtype(final.dtype))
    pixels = (final, last, g_image, g_depth, g_final)
    gradient = backward(*(x[None] for x in (*inputs, *pixels)))[0]
    no_gradient: Any = np.zeros(inputs[3].shape, jax.dtypes.float0)
    splats = Splats(gradient[:, :2], gradient[:, 2:5], gradient[:, 6], gradient[:, 5], no_gradient)
    return splats, gradient[:, 7:], jnp.einsum("hw,hwc->c", final, g_image)


_blend.defvjp(_blend_forward, _blend_backward)


def blend(
    splats: Splats,
    colour: Float[Array, "gaussian 3"],
    background: Float[Array, "3"],
    *,
    width: int,
    height: int,
    rules: str = "inria",
) -> tuple[Float[Array, "height width 3"], Float[Array, "height width"], Float[Array, "height width"]]:
    """Front-to-back alpha blending of screen-space splats over 16×16 tiles.

    alpha_i = min(alpha_max, o_i exp(-½ dᵀ Q_i d)) where at least 1/255, T_i = Π_{j<i} (1 - alpha_j);
    colour = Σ c_i alpha_i T_i + T·background, depth = Σ z_i alpha_i T_i, alpha = 1 - T (Kerbl et al. 2023, Eq. 3).

    Args:
        splats: from `project`; drawn front to back, ties in index order.
        colour: RGB, any range.
        background: RGB.
        width, height: pixels; need not be multiples of the tile.
        rules: a name in `RULES`.

    Returns:
        Colour, un-normalised depth (metres, the background adds nothing) and alpha.

    Raises:
        TypeError: splats and colours are not both float32 or both float64.
        jax.errors.JaxRuntimeError: if more than 2³¹-1 Gaussian-tile pairs are needed; the message names the number.
    """
    dtype = colour.dtype
    require_one_float(centre=splats.centre, colour=colour)
    if colour.shape[0] == 0:
        empty = jnp.zeros((height, width), dtype)
        return jnp.broadcast_to(background.astype(dtype), (height, width, 3)), empty, empty
    return _blend(splats, colour, background.astype(dtype), width, height, rules)


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
    """Draw 3D Gaussians with one camera; `jax.vmap` for many scenes or cameras.

    Args:
        mean: centres, metres, world frame.
        quaternion: w, x, y, z; normalised inside.
        scale: standard deviations, metres; zero draws the 0.3-pixel low-pass alone.
        opacity: 0..1.
        colour: RGB, used as it is.
        K: pinhole intrinsics, pixels; the centre of the top-left pixel is (0.5, 0.5).
        camera_from_world: rigid transform to OpenCV camera axes.
        background: RGB.
        shape: image size, near plane, rules and anti-aliasing.

    Returns:
        Colour, un-normalised depth Σ z alpha T, alpha, and how many Gaussians were dropped for non-finite attributes.
        Gradients reach every floating-point argument. Depth passes d/dz_i = alpha_i T_i on, and through the weights.

    Raises:
        TypeError: the arrays (but the background, which is cast) are not all float32 or all float64; names them.
    """
    attributes = {"mean": mean, "quaternion": quaternion, "scale": scale, "opacity": opacity, "colour": colour}
    require_one_float(**attributes, K=K, camera_from_world=camera_from_world)
    finite = usable(mean, quaternion, scale, opacity, colour)
    splats = project(mean, quaternion, scale, opacity, K, camera_from_world, finite, shape)
    colour = jnp.where(finite[:, None], colour, 0)
    images = blend(splats, colour, background, width=shape.width, height=shape.height, rules=shape.rules)
    return (*images, jnp.sum(~finite))
