"""Variations of assets: stretched, thinned and angular meshes, rotors at any speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerojax.simulate.assets.hybrids.variations import VariationConfig, angular, draw_factors, solids, thinned, varied
from aerojax.simulate.assets.mesh.lofts import RotorShape, rotor
from aerojax.simulate.assets.mesh.parts import Part, Spin
from aerojax.simulate.assets.mesh.shapes import box, ellipsoid, merge, tube
from aerojax.simulate.usd.authoring import Asset

NOTHING = VariationConfig(
    stretched=0.0, angular=0.0, without=0.0, thinned=0.0, loaded=0.0, stopped=0.0, slow=0.0, speed=(1.0, 1.0)
)
BLADES = rotor(RotorShape(2, 0.2, 0.02, 0.02))


def _asset() -> Asset:
    gear = merge(*(tube((x, y, -0.1), (x, y, -0.3), 0.01) for x in (-0.2, 0.2) for y in (-0.1, 0.1)))
    return Asset((
        Part("hull", box((0.0, 0.0, 0.0), (0.8, 0.2, 0.2)), 0),
        Part("gear", gear, 3),
        Part("rotor", BLADES, 7, Spin((0.1, 0.2, 0.3), (0.0, 0.0, 1.0), 8.0)),
    ))  # fmt: skip


def _varied(seed: int = 0, **changed: object) -> Asset:
    config = replace(NOTHING, **changed)
    return varied(_asset(), "helicopter", config, np.random.default_rng(seed))


def test_without_variations_nothing_changes():
    for one, two in zip(_asset().parts, _varied().parts, strict=True):
        assert np.array_equal(one.mesh.points, two.mesh.points) and one.spin == two.spin


def test_stretched_bodies_keep_rotors_in_shape():
    asset = _varied(stretched=1.0)
    factors = asset.parts[0].mesh.points[0] / _asset().parts[0].mesh.points[0]
    assert (factors >= 0.75).all() and (factors <= 1.33).all() and np.ptp(factors) > 0.01
    spun = asset.parts[2]
    assert spun.spin.hub == pytest.approx(np.array([0.1, 0.2, 0.3]) * factors)
    assert spun.mesh.points == pytest.approx(BLADES.points * factors[:2].min())


def test_factors_cover_their_range():
    config = VariationConfig()
    drawn = np.array([draw_factors(config, np.random.default_rng(s)) for s in range(2000)])
    still = (drawn == 1.0).all(axis=1)
    assert still.mean() == pytest.approx(1 - config.stretched, abs=0.04)
    assert drawn.min() >= 0.75 and drawn.max() <= 1.33 and drawn[~still].min() < 0.76 and drawn.max() > 1.32


@pytest.mark.parametrize(
    ("changed", "low", "high"),
    [({"stopped": 1.0}, 0.0, 0.0), ({"slow": 1.0}, 0.4, 4.0), ({"speed": (0.7, 1.3)}, 5.6, 10.4)],
)
def test_rotors_stand_or_turn_at_other_speeds(changed, low, high):
    rates = [_varied(seed, **changed).parts[2].spin.hertz for seed in range(20)]
    assert all(low <= rate <= high for rate in rates)


def test_parts_may_be_missing_or_lose_solids():
    assert [p.name for p in _varied(without=1.0).parts] == ["hull", "rotor"]
    left = [int(solids(_varied(seed, thinned=1.0).parts[1].mesh).max()) + 1 for seed in range(20)]
    assert set(left) <= {2, 3} and len(set(left)) >= 1


def test_thinning_takes_what_is_together():
    pairs = [
        merge(tube((x, 0.0, 0.0), (x, 0.0, -1.0), 0.05), box((x, 0.0, -1.0), (0.2, 0.2, 0.2))) for x in (-1.0, 1.0)
    ]
    for seed in range(20):
        mesh = thinned(merge(*pairs), np.random.default_rng(seed))
        assert 2 <= solids(mesh).max() + 1 <= 3
        assert mesh.faces.max() + 1 == len(mesh.points)
    alone = box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    assert thinned(alone, np.random.default_rng(0)) is alone


def test_loads_hang_below_the_body():
    for seed in range(8):
        load = _varied(seed, loaded=1.0).parts[-1]
        assert load.name == "load" and load.mesh.points[:, 2].max() <= -0.1 + 0.03


def test_angular_meshes_are_closed_coarse_and_where_they_were():
    mesh = merge(ellipsoid((0.0, 0.0, 0.0), (0.5, 0.2, 0.2), 20, 24), tube((0.0, 0.3, 0.0), (1.0, 0.3, 0.0), 0.01))
    coarse, which = angular(mesh, 0.15)
    assert len(coarse.points) < 0.4 * len(mesh.points) and len(which) == len(mesh.points)
    assert np.linalg.norm(coarse.points[which] - mesh.points, axis=1).max() < 0.15 * np.sqrt(3)
    edges = np.sort(np.concatenate([coarse.faces[:, [0, 1]], coarse.faces[:, [1, 2]], coarse.faces[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all()
    thin = coarse.points[coarse.points[:, 1] > 0.25]
    assert np.ptp(thin[:, 1]) > 0.005 and np.ptp(thin[:, 2]) > 0.005


def test_tails_never_float():
    fuselage = Part("fuselage", box((0.0, 0.0, 0.0), (1.0, 0.1, 0.1)), 0)
    tail = Part("tail", merge(box((-0.45, 0.0, 0.1), (0.1, 0.01, 0.2)), box((-0.47, 0.0, 0.2), (0.1, 0.4, 0.01))), 0)
    config = replace(NOTHING, thinned=1.0)
    kept = set()
    for seed in range(12):
        asset = varied(Asset((fuselage, tail)), "airplane", config, np.random.default_rng(seed))
        mesh = asset.parts[1].mesh
        kept.add(int(solids(mesh).max()) + 1)
        assert mesh.points[:, 2].min() < 0.05
    assert kept == {1, 2}
