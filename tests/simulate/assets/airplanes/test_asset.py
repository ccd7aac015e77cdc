"""Shapes of every family of airplanes over several draws: closed, small, symmetric and in one piece."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import trimesh
from support.airplanes import built_airplane, part_points

from aerojax.simulate.assets.airplanes.families import airplane_families

each = pytest.mark.parametrize("family", airplane_families())


@each
def test_shapes_are_closed_small_symmetric_and_one_metre_wide(family):
    for seed in (0, 1, 2):
        asset = built_airplane(family, seed)
        assert np.ptp(part_points(asset, "wings")[:, 1]) == pytest.approx(1.0)
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
    asset = built_airplane(family)
    boxes = [(p.mesh.points.min(0), p.mesh.points.max(0)) for p in asset.parts if p.spin is None]
    group = list(range(len(boxes)))
    for i, j in combinations(range(len(boxes)), 2):
        (low, high), (other_low, other_high) = boxes[i], boxes[j]
        if (low <= other_high).all() and (other_low <= high).all():
            group = [group[i] if g == group[j] else g for g in group]
    assert len(set(group)) == 1
