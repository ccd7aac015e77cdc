"""The U-Net of LGM: residual blocks on each view, and attention over the pixels of all views at the coarse levels."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Key

from aerojax.reconstruct.lgm.config import LgmConfig

INPUTS, OUTPUTS = 9, 14
"""Colour and Plücker coordinates of a pixel's ray; position, opacity, scale, rotation and colour of its Gaussian."""
SHARE = math.sqrt(0.5)
"""Of a sum of two branches, which keeps its variance."""


class Residual(nnx.Module):
    """Norm, SiLU, convolution, twice; beside them the input, by a 1×1 convolution where widths differ."""

    def __init__(self, inputs: int, outputs: int, config: LgmConfig, *, rngs: nnx.Rngs):
        kind = jnp.dtype(config.precision)
        self.norm1 = nnx.GroupNorm(inputs, config.groups, epsilon=1e-5, rngs=rngs)
        self.conv1 = nnx.Conv(inputs, outputs, (3, 3), dtype=kind, rngs=rngs)
        self.norm2 = nnx.GroupNorm(outputs, config.groups, epsilon=1e-5, rngs=rngs)
        self.conv2 = nnx.Conv(outputs, outputs, (3, 3), dtype=kind, rngs=rngs)
        self.beside = None if inputs == outputs else nnx.Conv(inputs, outputs, (1, 1), dtype=kind, rngs=rngs)

    def __call__(self, x: Float[Array, "view row column inputs"]) -> Float[Array, "view row column outputs"]:
        """One block."""
        y = self.conv1(nnx.silu(_normed(self.norm1, x)))
        y = self.conv2(nnx.silu(_normed(self.norm2, y)))
        return (y + (x if self.beside is None else self.beside(x))) * jnp.asarray(SHARE, y.dtype)


class ViewAttention(nnx.Module):
    """Every pixel of every view attends to those of all views that count."""

    def __init__(self, width: int, config: LgmConfig, *, rngs: nnx.Rngs):
        kind = jnp.dtype(config.precision)
        self.norm = nnx.GroupNorm(width, config.groups, epsilon=1e-5, rngs=rngs)
        self.read = nnx.Linear(width, 3 * width, use_bias=False, dtype=kind, rngs=rngs)
        self.out = nnx.Linear(width, width, dtype=kind, rngs=rngs)
        self.heads = config.heads

    def __call__(
        self, x: Float[Array, "view row column width"], valid: Bool[Array, "view"]
    ) -> Float[Array, "view row column width"]:
        """Attend."""
        views, rows, columns, width = x.shape
        tokens = self.read(_normed(self.norm, x).reshape(-1, width)).reshape(-1, 3, self.heads, width // self.heads)
        q, k, v = (tokens[:, i] for i in range(3))
        scores = jnp.einsum("qhc,khc->hqk", q, k).astype(jnp.float32) / math.sqrt(q.shape[-1])
        counts = jnp.repeat(valid, rows * columns)[None, None, :]
        shares = jax.nn.softmax(jnp.where(counts, scores, -1e9), axis=-1).astype(v.dtype)
        y = jnp.einsum("hqk,khc->qhc", shares, v)
        return (x + self.out(y.reshape(views, rows, columns, width))) * jnp.asarray(SHARE, x.dtype)


class Level(nnx.Module):
    """Residual blocks of one resolution, each followed by attention if it attends."""

    def __init__(self, inputs: tuple[int, ...], width: int, config: LgmConfig, *, attends: bool, rngs: nnx.Rngs):
        self.blocks = nnx.List([Residual(one, width, config, rngs=rngs) for one in inputs])
        self.attention = nnx.List([ViewAttention(width, config, rngs=rngs) for _ in inputs] if attends else [])

    def attended(self, x: Array, index: int, valid: Bool[Array, "view"]) -> Array:
        """Block number `index` and its attention."""
        x = self.blocks[index](x)
        return self.attention[index](x, valid) if len(self.attention) else x


class LgmNetwork(nnx.Module):
    """Images with their rays in, fourteen numbers a pixel of half the size out."""

    def __init__(self, config: LgmConfig, *, key: Key[Array, ""]):
        rngs, kind = nnx.Rngs(key), jnp.dtype(config.precision)
        down, up = config.down, config.up
        self.first = nnx.Conv(INPUTS, down[0], (3, 3), dtype=kind, rngs=rngs)
        levels, skips, width = [], [down[0]], down[0]
        for index, wide in enumerate(down):
            inputs = (width, *[wide] * (config.blocks - 1))
            levels.append(Level(inputs, wide, config, attends=config.attends_down[index], rngs=rngs))
            skips += [wide] * (config.blocks + (index < len(down) - 1))
            width = wide
        self.down = nnx.List(levels)
        self.halve = nnx.List([nnx.Conv(w, w, (3, 3), 2, padding=1, dtype=kind, rngs=rngs) for w in down[:-1]])
        self.middle = nnx.List([Residual(width, width, config, rngs=rngs) for _ in range(2)])
        self.across = ViewAttention(width, config, rngs=rngs)
        levels = []
        for index, wide in enumerate(up):
            taken = [skips.pop() for _ in range(config.blocks + 1)]
            inputs = tuple((width if i == 0 else wide) + skip for i, skip in enumerate(taken))
            levels.append(Level(inputs, wide, config, attends=config.attends_up[index], rngs=rngs))
            width = wide
        self.up = nnx.List(levels)
        self.double = nnx.List([nnx.Conv(w, w, (3, 3), dtype=kind, rngs=rngs) for w in up[:-1]])
        self.norm = nnx.GroupNorm(width, config.groups, epsilon=1e-5, rngs=rngs)
        self.last = nnx.Conv(width, OUTPUTS, (3, 3), dtype=kind, rngs=rngs)
        self.mixed = nnx.Conv(OUTPUTS, OUTPUTS, (1, 1), rngs=rngs)

    def __call__(
        self, images: Float[Array, "view size size 9"], valid: Bool[Array, "view"]
    ) -> Float[Array, "view half half 14"]:
        """Run."""
        x = self.first(images)
        skips = [x]
        for index, level in enumerate(self.down):
            for block in range(len(level.blocks)):
                x = level.attended(x, block, valid)
                skips.append(x)
            if index < len(self.halve):
                x = self.halve[index](x)
                skips.append(x)
        x = self.middle[1](self.across(self.middle[0](x), valid))
        for index, level in enumerate(self.up):
            for block in range(len(level.blocks)):
                x = level.attended(jnp.concatenate([x, skips.pop()], axis=-1), block, valid)
            if index < len(self.double):
                x = self.double[index](jnp.repeat(jnp.repeat(x, 2, axis=1), 2, axis=2))
        return self.mixed(self.last(nnx.silu(_normed(self.norm, x))).astype(jnp.float32))


def _normed(norm: nnx.GroupNorm, x: Float[Array, "view row column width"]) -> Float[Array, "view row column width"]:
    """Normalised in float32, whatever the precision of the convolutions."""
    return norm(x.astype(jnp.float32)).astype(x.dtype)
