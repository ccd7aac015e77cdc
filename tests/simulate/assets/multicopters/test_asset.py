"""Every family of multicopters over several draws: closed, one piece, one metre, blades clear."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support.rotorcraft_solids import is_closed, loose_pieces, placed, struck_share, triangles

from aerojax.simulate.assets.mesh.shapes import Mesh, box, merge, moved, tube
from aerojax.simulate.assets.multicopters import layout as multicopter_layout
from aerojax.simulate.assets.multicopters.asset import build_multicopter
from aerojax.simulate.assets.multicopters.families import draw_multicopter, multicopter_families
from aerojax.simulate.usd.authoring import Asset

DRAWS = range(3)


each = pytest.mark.parametrize("family", multicopter_families())


def _built(family: str, seed: int) -> Asset:
    rng = np.random.default_rng(seed)
    return build_multicopter(draw_multicopter(family, rng), rng)


def _hubs(asset: Asset) -> np.ndarray:
    return np.array([part.spin.hub for part in asset.parts if part.spin is not None])


@each
def test_solids_are_closed_finite_and_cheap(family):
    for seed in DRAWS:
        asset = _built(family, seed)
        for part in asset.parts:
            assert np.isfinite(part.mesh.points).all()
            assert is_closed(part.mesh), part.name
        assert 900 <= triangles(asset) <= 6000
        assert max(np.abs(placed(part).points).max() for part in asset.parts) < 1.0


@each
def test_one_piece_whose_propellers_strike_nothing(family):
    for seed in DRAWS:
        asset = _built(family, seed)
        assert loose_pieces(asset) == 1
        assert struck_share(asset) == 0


@each
def test_largest_distance_between_motors_is_one_metre(family):
    hubs = _hubs(_built(family, 5))[:, :2]
    assert np.linalg.norm(hubs[:, None] - hubs[None], axis=-1).max() == pytest.approx(1.0, abs=1e-9)


@each
def test_rates_alternate_and_discs_do_not_overlap(family):
    parameters = draw_multicopter(family, np.random.default_rng(2))
    asset = build_multicopter(parameters, np.random.default_rng(3))
    spins = [part.spin for part in asset.parts if part.spin is not None]
    assert all(65 <= abs(spin.hertz) <= 156 for spin in spins)
    assert sum(np.sign(spin.hertz) for spin in spins) == (len(spins) % 2)
    level = _hubs(asset)[:: 2 if parameters.coaxial else 1]
    apart = np.linalg.norm(level[:, None] - level[None], axis=-1) + 9 * np.eye(len(level))
    assert apart.min() > 1.98 * multicopter_layout.propeller_radius(parameters)


def test_measures_notice_a_loose_part_and_a_struck_blade():
    asset = _built("research_quad", 0)
    away = dataclasses.replace(asset.parts[0], name="stray", mesh=box((0.0, 0.0, 0.9), (0.1, 0.1, 0.1)))
    assert loose_pieces(dataclasses.replace(asset, parts=(*asset.parts, away))) == 2
    x, y, z = next(part.spin.hub for part in asset.parts if part.spin is not None)
    post = tube((x, y - 0.1, z - 0.1), (x, y - 0.1, z + 0.1), 0.01)
    struck = dataclasses.replace(asset.parts[0], name="post", mesh=post)
    assert struck_share(dataclasses.replace(asset, parts=(*asset.parts, struck))) > 0.4
    cube = box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    inside_out = Mesh(cube.points, cube.faces[:, ::-1].copy())
    assert is_closed(merge(cube, moved(cube, (3.0, 0.0, 0.0))))
    assert not is_closed(Mesh(cube.points, cube.faces[1:]))
    assert not is_closed(merge(cube, moved(inside_out, (3.0, 0.0, 0.0))))


def test_neighbouring_propellers_turn_against_each_other():
    parameters = draw_multicopter("research_quad", np.random.default_rng(3))
    built = build_multicopter(parameters, np.random.default_rng(4))
    rates = [p.spin.hertz for p in built.parts if p.spin is not None]
    assert [np.sign(r) for r in rates] == [1, -1, 1, -1]
    assert all(65 <= abs(r) <= 140 for r in rates)
