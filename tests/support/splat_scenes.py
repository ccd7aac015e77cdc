"""Small scenes and cameras for the splatter's tests."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.core.types import Camera, Gaussians
from aerojax.gaussians.render import render
from aerojax.geometry.cameras import look_at

QUICK = {"xla_backend_optimization_level": 0}
"""Compiling is most of these tests' time."""


def make_gaussians(seed: int, count: int = 60, coefficients: int = 4, dtype=np.float64, **ranges) -> Gaussians:
    rng = np.random.default_rng(seed)
    low, high = ranges.get("sigma", (0.03, 0.15))
    values = (
        rng.normal(0, ranges.get("spread", 0.3), (count, 3)),
        rng.normal(size=(count, 4)),
        np.exp(rng.uniform(np.log(low), np.log(high), (count, 3))),
        rng.uniform(*ranges.get("opacity", (0.05, 0.9)), count),
        rng.normal(0, 0.4, (count, coefficients, 3)),
    )
    return Gaussians(*[jnp.asarray(x, dtype) for x in values])


def make_camera(centre=(1.6, 0.3, 0.4), dtype=np.float64, size=(44, 36)) -> Camera:
    width, height = size
    K = jnp.array([[40.0, 0, 20.5], [0, 46.0, 19.0], [0, 0, 1]], dtype)
    pose = look_at(jnp.array(centre, dtype), jnp.zeros(3, dtype))
    return Camera(K, pose, width, height)


BACKGROUND = (0.9, 0.2, 0.4)


@functools.cache
def drawing(rules: str = "inria", antialias: bool = False, backend: str = "warp"):
    draw = functools.partial(render, rules=rules, antialias=antialias, backend=backend)
    return jax.jit(draw, compiler_options=QUICK)


def assert_same(a, b, atol):
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=atol)


def single(mean, sigma, opacity=0.8, rgb=(1.0, 0.0, 0.0)) -> Gaussians:
    sh = (np.array(rgb, np.float32) - 0.5)[None, None] / 0.28209479177387814
    columns = (np.array([mean]), np.array([[1.0, 0, 0, 0]]), np.full((1, 3), sigma), np.array([opacity]), sh)
    return Gaussians(*[jnp.asarray(x, jnp.float32) for x in columns])


LOOKING_ALONG_Z = Camera(jnp.array([[30.0, 0, 9.5], [0, 30.0, 10.5], [0, 0, 1]]), jnp.eye(4), 23, 19)
