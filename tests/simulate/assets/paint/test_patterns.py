"""Patterns: smooth noise, layers that lie where they say, plain parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.painted_assets import layer, surface_at

from aerojax.simulate.assets.paint import patterns


def test_noise_is_smooth_and_covers_the_range():
    points = np.random.default_rng(0).uniform(-20, 20, (20000, 3))
    noise = patterns.value_noise(points, 7)
    assert 0 <= noise.min() < 0.1 and 0.9 < noise.max() <= 1 and abs(noise.mean() - 0.5) < 0.02
    near = patterns.value_noise(points + 1e-4, 7)
    assert np.abs(near - noise).max() < 1e-3
    assert np.abs(patterns.value_noise(points, 8) - noise).mean() > 0.1
    lattice = np.array([[1.0, -2.0, 3.0]])  # on the lattice the noise is the hash itself, from either side
    assert patterns.value_noise(lattice, 7) == pytest.approx(patterns.value_noise(lattice - 1e-9, 7), abs=1e-6)


@pytest.mark.parametrize("kind", sorted(patterns.MASKS))
def test_every_layer_covers_a_part_of_the_object(kind):
    position = np.random.default_rng(1).uniform(-0.5, 0.5, (20000, 3)) * [1, 1, 0.2]
    normal = (0.0, 0.0, -1.0) if kind == "belly" else (0.0, 0.0, 1.0)
    cover = patterns.MASKS[kind](layer(kind), surface_at(position, normal))
    assert cover.min() >= 0 and cover.max() <= 1
    assert cover.mean() > 0.001 and (cover.mean() < 0.9 or kind == "belly")


def test_layers_lie_where_they_say():
    at = np.array([[0.0, 0.1, 0.0], [0.0, 0.49, 0.0], [0.45, 0.0, 0.0], [-0.45, 0.0, 0.0]])
    assert patterns.MASKS["tips"](layer("tips"), surface_at(at)) == pytest.approx([0, 1, 0, 0])
    assert patterns.MASKS["hood"](layer("hood"), surface_at(at)) == pytest.approx([0, 0, 1, 0])
    assert patterns.MASKS["rump"](layer("rump"), surface_at(at)) == pytest.approx([0, 0, 0, 1])
    assert patterns.MASKS["belly"](layer("belly"), surface_at(at, (0.0, 0.0, 1.0))).max() == 0
    assert patterns.MASKS["belly"](layer("belly"), surface_at(at, (0.0, 0.0, -1.0))).min() == 1


def test_unpatterned_roles_keep_their_colour():
    paint = patterns.draw_paint(5)
    plain = replace(paint, patterned=np.zeros(patterns.ROLES, bool), grain=0.0)
    position = np.random.default_rng(1).uniform(-0.5, 0.5, (50, 3))
    for role in range(patterns.ROLES):
        seen = patterns.colours(plain, role, surface_at(position))
        assert seen == pytest.approx(np.repeat(paint.palette.srgb[paint.slot_of[role]][None], 50, axis=0))


def test_glass_has_no_pattern():
    paint = replace(patterns.draw_paint(5), grain=0.0, patterned=np.ones(patterns.ROLES, bool))
    position = np.random.default_rng(1).uniform(-0.5, 0.5, (2000, 3))
    assert np.ptp(patterns.colours(paint, 1, surface_at(position), plain=True), axis=0).max() == 0
    assert np.ptp(patterns.colours(paint, 1, surface_at(position)), axis=0).max() > 0.05
