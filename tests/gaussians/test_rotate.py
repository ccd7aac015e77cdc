"""A batch of rotations is the loop over them, and shapes that do not fit are named."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.splat_scenes import make_gaussians

from aerojax.core.errors import UserError
from aerojax.gaussians.rotate import rotate
from aerojax.geometry.rotations import haar_rotation


@pytest.fixture(scope="module")
def turns():
    return jax.vmap(lambda key: haar_rotation(key=key))(jax.random.split(jax.random.key(0), 6))


def same(a, b):
    for one, other in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)


def test_one_scene_turned_in_several_ways(turns):
    gaussians = make_gaussians(0, 5, 4, np.float32)
    turned = rotate(gaussians, turns.reshape(2, 3, 3, 3))
    assert turned.mean.shape == (2, 3, 5, 3) and turned.sh.shape == (2, 3, *gaussians.sh.shape)
    same(jax.tree.map(lambda leaf: leaf[1, 2], turned), rotate(gaussians, turns[5]))


def test_every_scene_by_its_own(turns):
    scenes = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(make_gaussians(i, 5, 4, np.float32) for i in range(3)))
    turned = rotate(scenes, turns[:3])
    for i in range(3):
        same(jax.tree.map(lambda leaf, i=i: leaf[i], turned), rotate(make_gaussians(i, 5, 4, np.float32), turns[i]))
    same(rotate(scenes, turns[:1]), rotate(scenes, turns[0]))


def test_shapes_that_do_not_fit_are_named(turns):
    scenes = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(make_gaussians(i, 5, 4, np.float32) for i in range(3)))
    with pytest.raises(UserError, match=r"rotation is a batch of \(2,\), gaussians one of \(3,\)"):
        rotate(scenes, turns[:2])
    with pytest.raises(UserError, match=r"rotation has shape \(4, 4\); its last two axes must be 3, 3"):
        rotate(scenes, jnp.eye(4))
