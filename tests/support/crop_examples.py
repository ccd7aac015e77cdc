"""Crops of silhouettes that flap, roll and drift, for the tests of the classifiers of views."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from aerojax.core.types import Crops

SIZE = 32


def winged(bend, roll, *, wing=11.0, shift=(0.0, 0.0)):
    """Coverage of a body with two bent wings and a short tail, smooth edges; `roll` in radians about the middle."""
    at = np.arange(SIZE) + 0.5 - SIZE / 2
    x, y = np.meshgrid(at - shift[0], at - shift[1])
    u, v = np.cos(roll) * x + np.sin(roll) * y, np.cos(roll) * y - np.sin(roll) * x
    inside = np.maximum(
        1 - (u / 2.5) ** 2 - (v / 7) ** 2, 1 - (u / wing) ** 2 - ((v + 2 - bend * np.abs(u)) / 1.8) ** 2
    )
    inside = np.maximum(inside, 1 - ((u - 1) / 3.5) ** 2 - ((v - 7) / 1.2) ** 2)
    return 1 / (1 + np.exp(-6 * np.clip(inside, -8, 8)))


def random_crops(seed, *, time=6, views=4):
    """A clip of winged silhouettes, every camera with a roll, wings and colour of its own; all valid."""
    rng = np.random.default_rng(seed)
    phase, rate = rng.uniform(0, 6), rng.uniform(0.5, 1.5)
    rolls, wings, offsets = rng.uniform(0, 6, views), rng.uniform(6, 13, views), rng.uniform(-1, 1, (views, 2))
    frames = np.sin(phase + rate * np.arange(time))
    coverage = np.stack(
        [
            [winged(0.6 * bend, r, wing=w, shift=o) for r, w, o in zip(rolls, wings, offsets, strict=True)]
            for bend in frames
        ]
    )
    rgb = coverage[..., None] * rng.uniform(0, 1, (1, views, 1, 1, 3))
    rgba = np.concatenate([rgb, coverage[..., None]], axis=-1).astype(np.float32)
    return crops_of(rgba, np.ones((time, views), bool))


def crops_of(rgba, valid):
    """Crops of host arrays."""
    return Crops(jnp.asarray(rgba), jnp.asarray(valid))
