"""The plane sweep on a textured plane that can be computed by hand, and the range of depths."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.depthsplat_examples import rig

from aerojax.core.types import Camera
from aerojax.geometry.cameras import look_at
from aerojax.reconstruct.depthsplat.config import DepthSplatConfig
from aerojax.reconstruct.depthsplat.cost_volume import (
    THESIS_HALF_WIDTH,
    depth_range,
    feature_cameras,
    plane_sweep,
)
from aerojax.reconstruct.depthsplat.grids import resize
from aerojax.reconstruct.depthsplat.transformer import neighbours_of

SIZE, CELLS, CANDIDATES = 128, 32, 48
NORMAL, OFFSET = np.array([0.2, -0.1, 1.0]), 0.05
"""Points x of the plane: NORMAL·x = OFFSET."""


def plane_cameras():
    """Four cameras above the plane, each with focal lengths and a principal point of its own."""
    centres = np.array([[0.5, 0.1, 1.4], [-0.4, 0.3, 1.5], [0.1, -0.5, 1.3], [0.0, 0.4, 1.6]], np.float32)
    poses = jnp.stack([look_at(jnp.asarray(c), jnp.zeros(3)) for c in centres])
    K = np.zeros((4, 3, 3), np.float32)
    K[:, 0, 0], K[:, 1, 1] = [140, 180, 120, 160], [150, 170, 130, 150]
    K[:, 0, 2], K[:, 1, 2], K[:, 2, 2] = [64, 58, 70, 61], [60, 66, 64, 70], 1.0
    return Camera(jnp.asarray(K), poses, SIZE, SIZE)


def plane_at(camera, step):
    """Inverse depth and texture coordinates of the plane at every `step`-th pixel's centre, each view."""
    K, poses = np.asarray(camera.K, float), np.asarray(camera.world_from_cam, float)
    place = np.arange(0, SIZE, step) + 0.5
    pixels = np.stack([*np.meshgrid(place, place), np.ones((len(place),) * 2)], axis=-1)
    rays = np.einsum("vij,hwj->vhwi", np.linalg.inv(K), pixels)
    turned = np.einsum("vij,vhwj->vhwi", poses[:, :3, :3], rays)
    depth = (OFFSET - poses[:, :3, 3] @ NORMAL)[:, None, None] / (turned @ NORMAL)
    points = poses[:, None, None, :3, 3] + depth[..., None] * turned
    return 1 / depth, points[..., :2]


def texture(points):
    """Random waves of a few cells' length: equal at equal places, different at different ones."""
    rng = np.random.default_rng(3)
    waves, phase = rng.normal(0, 9, (2, 48)), rng.uniform(0, 2 * np.pi, 48)
    return jnp.asarray(np.cos(points @ waves + phase), jnp.float32)


@pytest.fixture(scope="module")
def swept():
    cameras, valid = plane_cameras(), jnp.ones(4, bool)
    inverse, points = plane_at(cameras, 4)
    candidates = np.linspace(1 / 2.5, 1 / 0.8, CANDIDATES)
    neighbours = neighbours_of(cameras.world_from_cam[:, :3, 3], valid, 3)
    levels = jnp.broadcast_to(jnp.asarray(candidates, jnp.float32), (4, CANDIDATES))

    def sweep(*, compat):
        cells = feature_cameras(cameras, compat=compat)
        return plane_sweep(texture(points), cells, neighbours, levels, compat=compat)

    return {compat: jax.device_get(sweep(compat=compat)) for compat in (False, True)}, inverse, candidates


def found_bins(swept, *, compat):
    """How far the best candidate is from the true one, where two other views at least show the point."""
    sweeps, inverse, candidates = swept
    true = np.abs(candidates - inverse[..., None]).argmin(axis=-1)
    seen = np.take_along_axis(sweeps[False].seen, true[..., None], axis=-1)[..., 0] >= 2
    return np.abs(sweeps[compat].cost.argmax(axis=-1) - true)[seen]


def test_the_true_depth_agrees_best_whatever_the_cameras_K(swept):
    off = found_bins(swept, compat=False)
    assert len(off) > 1000 and np.mean(off <= 1) > 0.98 and np.median(off) == 0


def test_upstreams_shortcuts_miss_it(swept):
    assert np.mean(found_bins(swept, compat=True) <= 1) < 0.5


def test_depth_of_the_plane_at_full_resolution(swept):
    """Soft maximum in inverse depth, which is linear over the image of a plane, and resampling to pixels."""
    sweeps, _, candidates = swept
    share = jax.nn.softmax(40.0 * jnp.asarray(sweeps[False].cost), axis=-1)
    coarse = share @ jnp.asarray(candidates, jnp.float32)
    whole = np.asarray(resize(coarse[..., None], SIZE, compat=False)[..., 0])
    true, _ = plane_at(plane_cameras(), 1)
    inner = (slice(None), slice(24, -24), slice(24, -24))
    error = np.abs(1 / whole - 1 / true)[inner]
    assert np.median(error) < 0.01 and np.quantile(error, 0.95) < 0.03


def test_a_view_that_does_not_count_changes_nothing():
    cameras = rig(4, 32)
    features = jnp.asarray(np.random.default_rng(0).normal(size=(4, 8, 8, 4)), jnp.float32)
    inverse = jnp.broadcast_to(jnp.linspace(0.5, 1.5, 5), (4, 5))
    cells = feature_cameras(cameras, compat=False)

    def swept(count, features):
        valid = jnp.arange(4) < count
        neighbours = neighbours_of(cameras.world_from_cam[:, :3, 3], valid, 3)
        return plane_sweep(features, cells, neighbours, inverse, compat=False)

    three, changed = swept(3, features), swept(3, features.at[3].add(5.0))
    np.testing.assert_array_equal(three.cost[:3], changed.cost[:3])
    assert float(jnp.max(three.seen[:3])) <= 2 and not np.allclose(swept(4, features).cost[:3], three.cost[:3])
    assert float(jnp.max(jnp.abs(swept(1, features).cost[0]))) == 0.0


def test_what_no_view_shows_costs_nothing():
    """Behind a camera and beside its image nothing is compared."""
    cameras = dataclasses.replace(rig(2, 32), K=rig(2, 32).K.at[:, :2, 2].add(jnp.asarray([900.0, 0.0])[None]))
    neighbours = neighbours_of(cameras.world_from_cam[:, :3, 3], jnp.ones(2, bool), 1)
    sweep = plane_sweep(jnp.ones((2, 8, 8, 4)), feature_cameras(cameras, compat=False), neighbours,
                        jnp.full((2, 3), 0.7), compat=False)  # fmt: skip
    assert float(jnp.sum(sweep.seen)) == 0.0 and float(jnp.sum(jnp.abs(sweep.cost))) == 0.0


def thesis_cameras(distance, half_width):
    focal = distance * 128 / half_width
    K = jnp.asarray([[focal, 0, 128], [0, focal, 128], [0, 0, 1]], jnp.float32)
    poses = jnp.stack([look_at(jnp.asarray(c, jnp.float32), jnp.zeros(3)) for c in np.eye(3) * distance])
    return Camera(jnp.broadcast_to(K, (3, 3, 3)), poses, 256, 256)


@pytest.mark.parametrize("bins", ["window", "global"])
def test_range_of_the_thesis(bins):
    span = depth_range(thesis_cameras(1.5, THESIS_HALF_WIDTH), jnp.ones(3, bool), DepthSplatConfig(bins=bins))
    np.testing.assert_allclose(span.near, 0.55, rtol=1e-5)
    np.testing.assert_allclose(span.far, 2.54, rtol=1e-5)
    assert float(span.unit) == pytest.approx(1.0, rel=1e-5)
    np.testing.assert_allclose(span.inverse_depth(jnp.zeros((3, 2))), 1 / 2.54, rtol=1e-5)
    np.testing.assert_allclose(span.inverse_depth(jnp.ones((3, 2))), 1 / 0.55, rtol=1e-5)


def test_the_window_says_how_deep_an_object_can_be():
    """A telephoto view of half a metre at 100 m: the range is that of half a metre."""
    cameras = thesis_cameras(100.0, 0.5)
    span = depth_range(cameras, jnp.ones(3, bool), DepthSplatConfig())
    unit = 0.5 / THESIS_HALF_WIDTH
    assert float(span.unit) == pytest.approx(unit, rel=1e-5)
    np.testing.assert_allclose(span.near, 100 - 0.95 * unit, rtol=1e-5)
    np.testing.assert_allclose(span.far, 100 + 1.04 * unit, rtol=1e-5)
    whole = depth_range(cameras, jnp.ones(3, bool), DepthSplatConfig(bins="global"))
    assert float(whole.far[0] - whole.near[0]) > 100  # the thesis' bins are wider than any object


def test_range_without_a_view_is_finite():
    span = depth_range(thesis_cameras(1.5, 0.7), jnp.zeros(3, bool), DepthSplatConfig())
    assert np.isfinite(span.near).all() and np.all(np.asarray(span.near) < np.asarray(span.far))
