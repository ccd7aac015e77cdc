"""Engines and propellers of airplanes."""

from __future__ import annotations

import numpy as np
import pytest
from support.airplanes import built_airplane, part_points

from aerojax.simulate.assets.airplanes.families import airplane_families, draw_airplane

each = pytest.mark.parametrize("family", airplane_families())


def test_paired_pods_double_the_engines():
    one, two = (part_points(built_airplane("jet_bomber", pod_pair=pair), "engines") for pair in (False, True))
    assert len(two) > 1.5 * len(one)
    assert two[:, 1].max() > one[:, 1].max() and two[:, 1][two[:, 1] > 0].min() < one[:, 1][one[:, 1] > 0].min()


def test_only_what_has_propellers_spins():
    for family in airplane_families():
        asset = built_airplane(family)
        power = draw_airplane(family, np.random.default_rng(0)).power
        spins = sum(p.spin is not None for p in asset.parts)
        assert (spins > 0) == (power in ("nose", "pusher", "overhead", "wing_propellers")), family


@each
def test_propellers_turn_clear_of_the_airplane(family):
    """No vertex of the fixed parts lies inside the disc that a propeller sweeps, but the hub's surroundings."""
    asset = built_airplane(family)
    fixed = np.concatenate([p.mesh.points for p in asset.parts if p.spin is None and p.name not in ("engines", "keel")])
    for part in asset.parts:
        if part.spin is not None:
            thick, radius = np.ptp(part.mesh.points[:, 2]) / 2, np.hypot(*part.mesh.points.T[:2]).max()
            offset = fixed - np.asarray(part.spin.hub)
            away = np.hypot(offset[:, 1], offset[:, 2])
            inside = (np.abs(offset[:, 0]) < 0.8 * thick) & (away < 0.9 * radius) & (away > 0.35 * radius)
            assert not inside.any(), part.name
