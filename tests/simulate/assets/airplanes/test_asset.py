"""Shapes of every family of airplanes over several draws, and what makes a kind what it is."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
import trimesh

from aerojax.simulate.assets.airplanes.asset import build_airplane
from aerojax.simulate.assets.airplanes.families import airplane_families, draw_airplane
from aerojax.simulate.usd.authoring import Asset

each = pytest.mark.parametrize("family", airplane_families())


def _built(family: str, seed: int = 0, **changes: Any) -> Asset:
    rng = np.random.default_rng(seed)
    return build_airplane(replace(draw_airplane(family, rng), **changes), rng)


def _part(asset: Asset, name: str) -> np.ndarray:
    return next(p.mesh.points for p in asset.parts if p.name == name)


@each
def test_shapes_are_closed_small_symmetric_and_one_metre_wide(family):
    for seed in (0, 1, 2):
        asset = _built(family, seed)
        assert np.ptp(_part(asset, "wings")[:, 1]) == pytest.approx(1.0)
        assert 500 <= sum(len(p.mesh.faces) for p in asset.parts) <= 6000
        for part in asset.parts:
            for piece in trimesh.Trimesh(part.mesh.points, part.mesh.faces, process=False).split(only_watertight=False):
                assert piece.is_watertight and piece.volume > 0, part.name
            if part.spin is None:
                low, high = part.mesh.points[:, 1].min(), part.mesh.points[:, 1].max()
                assert low == pytest.approx(-high, abs=1e-6), part.name


@each
def test_no_part_floats_free(family):
    """Every fixed part touches another: their boxes chain up to one airplane."""
    asset = _built(family)
    boxes = [(p.mesh.points.min(0), p.mesh.points.max(0)) for p in asset.parts if p.spin is None]
    group = list(range(len(boxes)))
    for i, j in combinations(range(len(boxes)), 2):
        (low, high), (other_low, other_high) = boxes[i], boxes[j]
        if (low <= other_high).all() and (other_low <= high).all():
            group = [group[i] if g == group[j] else g for g in group]
    assert len(set(group)) == 1


@each
def test_propellers_turn_clear_of_the_airplane(family):
    """No vertex of the fixed parts lies inside the disc that a propeller sweeps, but the hub's surroundings."""
    asset = _built(family)
    fixed = np.concatenate([p.mesh.points for p in asset.parts if p.spin is None and p.name not in ("engines", "keel")])
    for part in asset.parts:
        if part.spin is not None:
            thick, radius = np.ptp(part.mesh.points[:, 2]) / 2, np.hypot(*part.mesh.points.T[:2]).max()
            offset = fixed - np.asarray(part.spin.hub)
            away = np.hypot(offset[:, 1], offset[:, 2])
            inside = (np.abs(offset[:, 0]) < 0.8 * thick) & (away < 0.9 * radius) & (away > 0.35 * radius)
            assert not inside.any(), part.name


def test_floats_hang_below_everything_and_carry_the_balance_point():
    asset = _built("floatplane")
    floats, wings = _part(asset, "floats"), _part(asset, "wings")
    assert floats[:, 2].min() < min(_part(asset, n)[:, 2].min() for n in ("fuselage", "wings", "tail"))
    assert floats[:, 0].min() < wings[:, 0].mean() < floats[:, 0].max()


def test_paired_pods_double_the_engines():
    one, two = (_part(_built("jet_bomber", pod_pair=pair), "engines") for pair in (False, True))
    assert len(two) > 1.5 * len(one)
    assert two[:, 1].max() > one[:, 1].max() and two[:, 1][two[:, 1] > 0].min() < one[:, 1][one[:, 1] > 0].min()


def test_an_ultralight_hangs_its_seat_under_the_wing_and_its_tail_on_the_keel():
    asset = _built("ultralight")
    fuselage, wings, tail = (_part(asset, n) for n in ("fuselage", "wings", "tail"))
    assert fuselage[:, 2].max() < wings[:, 2].min()
    assert fuselage[:, 0].min() > tail[:, 0].max()
    assert _part(asset, "keel")[:, 0].min() < tail[:, 0].max()


def test_only_what_has_propellers_spins():
    for family in airplane_families():
        asset = _built(family)
        power = draw_airplane(family, np.random.default_rng(0)).power
        spins = sum(p.spin is not None for p in asset.parts)
        assert (spins > 0) == (power in ("nose", "pusher", "overhead", "wing_propellers")), family
