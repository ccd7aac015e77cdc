"""Gaussians in one plane a view: the door's promises, and that the own image comes back."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from support.hull_views import DISTANCE, rig, sphere_mask, views_of

from aerojax.core.images import peak_signal_to_noise
from aerojax.gaussians.render import render
from aerojax.reconstruct.base import Reconstructor
from aerojax.reconstruct.constant import ConstantConfig
from aerojax.reconstruct.packing import visible_first


def test_one_view_shows_its_own_image():
    views = views_of(rig(3), lambda camera: sphere_mask(camera, 0.4))
    member = ConstantConfig().build()
    found, count = jax.jit(lambda v, ok: member(v, ok))(views, jnp.array([False, True, False]))
    assert isinstance(member, Reconstructor) and 0 < int(count) < len(found.mean) // 3
    own = jax.tree.map(lambda leaf: leaf[1], views)
    depth = (np.asarray(found.mean) - np.asarray(own.camera.world_from_cam[:3, 3])) @ own.camera.world_from_cam[:3, 2]
    np.testing.assert_allclose(depth, DISTANCE, rtol=1e-5)
    real = jax.tree.map(lambda leaf: leaf[: int(count)], found)
    seen = render(real, own.camera, background=jnp.ones(3), antialias=True)
    assert float(peak_signal_to_noise(seen.colour, own.rgb, own.mask)) > 20.0


def test_what_can_be_seen_comes_first_and_nothing_is_no_object():
    views = views_of(rig(2), lambda camera: sphere_mask(camera, 0.4))
    found, count = ConstantConfig(square=8).build()(views, jnp.ones(2, bool))
    again, same = visible_first(found)
    assert int(same) == len(found.mean) > int(count)  # repeats of a real one are visible, too
    np.testing.assert_array_equal(again.mean, found.mean)
    np.testing.assert_array_equal(
        found.mean[int(count) :], jnp.broadcast_to(found.mean[0], found.mean[int(count) :].shape)
    )
    assert int(ConstantConfig().build()(views, jnp.zeros(2, bool))[1]) == 0
