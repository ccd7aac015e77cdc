"""The bucketed farthest points are those of the plain reference, index for index, ties included."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels.sampling.farthest_points import farthest_points
from kernels.sampling.farthest_points_reference import farthest_points as reference

RNG = np.random.default_rng(5)
SHELL = RNG.normal(size=(500, 3))
CLOUDS = {
    "normal": RNG.normal(size=(500, 3)),
    "shell": SHELL / np.linalg.norm(SHELL, axis=1, keepdims=True) + 0.3,
    "lattice, full of ties": RNG.integers(0, 6, size=(500, 3)),
    "line": np.arange(500)[:, None] * np.array([0.1, 0.0, 0.0]),
    "padded": np.concatenate([SHELL[:120], np.repeat(SHELL[:1], 380, axis=0)]),
    "one place": np.ones((500, 3)),
    "far from zero": 1e4 + RNG.integers(0, 4, size=(500, 3)) / 1024,
    "two clusters": np.concatenate([1e-4 * SHELL[:250], 50 + SHELL[250:]]),
}
COUNT = 200


@pytest.mark.parametrize("name", CLOUDS)
@pytest.mark.parametrize(("start", "min_square_norm"), [(0, None), (17, 1.0)])
def test_the_reference_index_for_index(name, start, min_square_norm):
    points = jnp.asarray(CLOUDS[name], jnp.float32)
    rule = {"count": COUNT, "start": start, "min_square_norm": min_square_norm}
    found = jax.jit(partial(farthest_points, **rule))(points)
    np.testing.assert_array_equal(found, jax.jit(partial(reference, **rule))(points))


def test_many_clouds_at_once():
    clouds = jnp.asarray(np.stack([CLOUDS["normal"], CLOUDS["shell"]]), jnp.float32)
    found = jax.jit(jax.vmap(partial(farthest_points, count=40)))(clouds)
    np.testing.assert_array_equal(found, jnp.stack([farthest_points(cloud, 40) for cloud in clouds]))


def test_the_number_of_points_may_be_small():
    points = jnp.asarray([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    np.testing.assert_array_equal(farthest_points(points, 5), [0, 2, 1, 0, 0])
