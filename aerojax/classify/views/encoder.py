"""One view's descriptor: convolutions along the angle of its polar image beside the closed-form descriptors."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float, Key

from aerojax.classify.mambasplat.layers import LayerNorm, Linear
from aerojax.classify.views.config import ViewsConfig
from aerojax.classify.views.descriptors import descriptor_count, silhouette_descriptors
from aerojax.classify.views.polar import fourier_magnitudes, moments, polar_image
from aerojax.core.types import pytree_dataclass

DILATIONS = (2, 4)
"""Of the residual convolutions: with the first one they see half a turn."""


@pytree_dataclass
class Outline:
    """What is read of one crop, before anything learned.

    area: pixels of coverage.
    polar: the image about its centre, coverage last of its channels.
    numbers: closed-form descriptors.
    """

    area: Float[Array, "*batch"]
    polar: Float[Array, "*batch radius angle channel"]
    numbers: Float[Array, "*batch descriptor"]


def outline(rgba: Float[Array, "size size 4"], config: ViewsConfig) -> Outline:
    """Of one crop: premultiplied sRGB and coverage, 0..1."""
    coverage = rgba[..., 3]
    about = moments(coverage)
    polar = polar_image(
        rgba[..., 4 - config.channels :], about, radii=config.radii, angles=config.angles, reach=config.reach
    )
    return Outline(about.area, polar, silhouette_descriptors(coverage, about, polar[..., -1], config.harmonics))


class AngularConvolution(nnx.Module):
    """A convolution along a closed angle axis, as one product with the shifted inputs side by side."""

    def __init__(self, inputs: int, outputs: int, taps: int, dilation: int, *, key: Key[Array, ""]):
        self.linear = Linear(taps * inputs, outputs, key=key)
        self.shifts = tuple(dilation * (tap - taps // 2) for tap in range(taps))

    def __call__(self, x: Float[Array, "angle inputs"]) -> Float[Array, "angle outputs"]:
        """Convolve; a shift of the input shifts the output."""
        return self.linear(jnp.concatenate([jnp.roll(x, shift, axis=0) for shift in self.shifts], axis=-1))


class ViewEncoder(nnx.Module):
    """The image now and its change since the frame before → a descriptor that a roll of the camera leaves unchanged.

    All radii of an angle are the convolutions' input channels: in units of the silhouette's radius, each has a meaning
    of its own. Over the angles the channels are pooled by mean, maximum and magnitudes of low frequencies.
    """

    def __init__(self, config: ViewsConfig, *, key: Key[Array, ""]):
        first, mlp, out, *blocks = jax.random.split(key, 3 + len(DILATIONS))
        inputs, width = 2 * config.radii * config.channels, config.width
        self.first = AngularConvolution(inputs, width, config.taps, 1, key=first)
        self.norms = nnx.List([LayerNorm(width) for _ in DILATIONS])
        self.convolutions = nnx.List(
            [AngularConvolution(width, width, config.taps, d, key=k) for d, k in zip(DILATIONS, blocks, strict=True)]
        )
        self.mlp = Linear(2 * descriptor_count(config.radii, config.harmonics) + config.radii, config.hidden, key=mlp)
        self.out = Linear((2 + config.pooled_harmonics) * width + config.hidden, config.view_width, key=out)
        self.harmonics = config.pooled_harmonics

    def __call__(self, now: Outline, before: Outline) -> Float[Array, "feature"]:
        """Encode one view; `before` is `now` where there is no frame before."""
        change = now.polar - before.polar
        x = jnp.concatenate([now.polar, change], axis=-1)
        x = jax.nn.relu(self.first(jnp.moveaxis(x, 1, 0).reshape(x.shape[1], -1)))
        for norm, convolution in zip(self.norms, self.convolutions, strict=True):
            x = x + jax.nn.relu(convolution(norm(x)))
        pooled = [x.mean(axis=0), x.max(axis=0), fourier_magnitudes(x, 1, self.harmonics).ravel()]
        moved = jnp.mean(jnp.abs(change[..., -1]), axis=1)
        numbers = jnp.concatenate([now.numbers, now.numbers - before.numbers, moved])
        return jax.nn.gelu(self.out(jnp.concatenate([*pooled, jax.nn.gelu(self.mlp(numbers))])))
