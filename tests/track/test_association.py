"""Rays of several cameras become objects: all of them, no others, each sight at most once, with honest covariances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.flights import path, ring, watch

from aerojax.track.association import NONE, AssociationConfig, Rays, associate, triangulate_sets
from aerojax.track.association import _greedy as greedy
from aerojax.track.association import _packing as packing
from aerojax.track.sights import NoiseConfig, sight_of_points

CONFIG, NOISE = AssociationConfig(), NoiseConfig()


def moment(seed: int, cameras, count: int = 5, **how):
    """Rays of one moment, who each is of, and where those are."""
    rng = np.random.default_rng(seed)
    paths = [path(rng) for _ in range(count)]
    seen = watch(paths, cameras, seconds=1 / 30, rng=rng, **how)
    places = np.stack([one.at(np.zeros(1))[0] for one in paths])
    d = seen.detections
    return Rays(d.camera, np.zeros(len(d.camera)), d.pixels, np.ones(len(d.camera))), seen.source, places


@pytest.mark.parametrize("seed", range(4))
def test_five_objects_without_ghosts(seed):
    """Missed and false detections; each object that three cameras show is found, of its own sights alone."""
    cameras = ring(4 + seed % 2, seed=seed)
    rays, source, places = moment(seed, cameras, missed=0.1, clutter=2.0)
    found = associate(rays, cameras, CONFIG, NOISE)
    used = found.sights[found.sights != NONE]
    assert len(used) == len(set(used.tolist()))
    owners = [set(source[row[row != NONE]].tolist()) for row in found.sights]
    expected = [k for k in range(5) if np.count_nonzero(source == k) >= 3]
    assert sorted(map(sorted, owners)) == [[k] for k in expected]
    for (owner,), state in zip(owners, found.state, strict=True):
        assert np.linalg.norm(state[:3] - places[owner]) < 0.5


def test_two_rays_are_not_enough():
    cameras = ring(4)
    rays, source, _ = moment(0, cameras, count=1, missed=0, clutter=0)
    keep = source == 0
    keep[2:] = False
    two = Rays(rays.camera[keep], rays.lag_s[keep], rays.pixels[keep], rays.variance[keep])
    assert len(associate(two, cameras, CONFIG, NOISE).sights) == 0
    assert len(associate(two, cameras, replace(CONFIG, min_views=2), NOISE).sights) == 1


def test_covariance_is_honest():
    """Squared errors in its own measure have mean 3; as many trials as bring that to within a tenth."""
    cameras = ring(4)
    rng = np.random.default_rng(1)
    point = np.array([3.0, -5.0, 25.0])
    still = replace(CONFIG, speed=1e-6)
    noise = NoiseConfig(rotation_deg=0.0, position_m=0.0)
    pixels = np.stack([sight_of_points(point, camera)[0] for camera in cameras])
    trials = 1000
    noisy = (pixels[:, None] + rng.normal(0, 2.0, (4, trials, 2))).reshape(-1, 2)
    rays = Rays(np.repeat(np.arange(4), trials), np.zeros(4 * trials), noisy, np.full(4 * trials, 4.0))
    sets = np.arange(4 * trials).reshape(4, trials).T
    found = triangulate_sets(sets, rays, cameras, still, noise)
    off = found.state[:, :3] - point
    measure = np.einsum("ti,tij,tj->t", off, np.linalg.inv(found.covariance[:, :3, :3]), off)
    assert measure.mean() == pytest.approx(3.0, abs=0.25)
    assert found.misfit.mean() == pytest.approx(5.0, abs=0.4)  # eight numbers less three


def test_sights_at_different_moments_allow_for_speed():
    """20 m/s and half a frame: far beyond pixel noise, near enough for a velocity."""
    cameras = ring(4)
    lags = np.array([0.0, 0.008, 0.016, 0.024])
    place, velocity = np.array([1.0, 2.0, 20.0]), np.array([15.0, -12.0, 3.0])
    pixels = np.stack([sight_of_points(place + lag * velocity, c)[0] for lag, c in zip(lags, cameras, strict=True)])
    rays = Rays(np.arange(4), lags, pixels, np.ones(4))
    found = associate(rays, cameras, CONFIG, NOISE)
    assert found.views.tolist() == [4]
    off = found.state[0] - np.concatenate([place, velocity])
    spread = np.sqrt(np.diag(found.covariance[0]))
    assert np.all(np.abs(off) < 3 * spread)
    frozen = associate(replace_lags(rays), cameras, replace(CONFIG, speed=0.1), NOISE)
    assert 4 not in frozen.views.tolist()  # the negative control: as if they were simultaneous


def replace_lags(rays: Rays) -> Rays:
    return Rays(rays.camera, np.zeros(len(rays.camera)), rays.pixels, rays.variance)


def test_packing_is_best_in_total_and_not_by_greed():
    sets = np.array([[0, 1, 2], [0, 3, 4], [5, 1, 6]])
    worth = np.array([5.0, 3.0, 3.0])
    assert packing(sets, worth, 7).tolist() == [1, 2]
    assert greedy(sets, worth, np.arange(3)).tolist() == [0]
    assert packing(sets, -worth, 7).tolist() == []
