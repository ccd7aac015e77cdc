"""Every multicopter family over several draws: closed, one piece, one metre, blades clear; layouts by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support.rotorcraft_solids import is_closed, loose_pieces, placed, struck_share, triangles

from aerojax.simulate.assets.mesh.shapes import Mesh, box, merge, moved, tube
from aerojax.simulate.assets.multicopters import author as multicopters
from aerojax.simulate.assets.multicopters import layout as multicopter_layout
from aerojax.simulate.assets.multicopters.families import FAMILIES, SPLITS
from aerojax.simulate.usd.authoring import Asset

DRAWS = range(3)
each = pytest.mark.parametrize("family", FAMILIES)


def _author(family: str, seed: int) -> Asset:
    rng = np.random.default_rng(seed)
    return multicopters.author(multicopters.draw_parameters(family, rng), rng)


def _hubs(asset: Asset) -> np.ndarray:
    return np.array([part.spin.hub for part in asset.parts if part.spin is not None])


def test_thirty_families_each_in_one_split():
    assert {split: len(names) for split, names in SPLITS.items()} == {"train": 15, "val": 7, "test": 8}
    names = [name for split in SPLITS.values() for name in split]
    assert sorted(names) == sorted(FAMILIES)


@each
def test_solids_are_closed_finite_and_cheap(family):
    for seed in DRAWS:
        asset = _author(family, seed)
        for part in asset.parts:
            assert np.isfinite(part.mesh.points).all()
            assert is_closed(part.mesh), part.name
        assert 900 <= triangles(asset) <= 6000
        assert max(np.abs(placed(part).points).max() for part in asset.parts) < 1.0


@each
def test_one_piece_whose_propellers_strike_nothing(family):
    for seed in DRAWS:
        asset = _author(family, seed)
        assert loose_pieces(asset) == 1
        assert struck_share(asset) == 0


@each
def test_largest_distance_between_motors_is_one_metre(family):
    hubs = _hubs(_author(family, 5))[:, :2]
    assert np.linalg.norm(hubs[:, None] - hubs[None], axis=-1).max() == pytest.approx(1.0, abs=1e-9)


@each
def test_rates_alternate_and_discs_do_not_overlap(family):
    parameters = multicopters.draw_parameters(family, np.random.default_rng(2))
    asset = multicopters.author(parameters, np.random.default_rng(3))
    spins = [part.spin for part in asset.parts if part.spin is not None]
    assert all(65 <= abs(spin.hertz) <= 156 for spin in spins)
    assert sum(np.sign(spin.hertz) for spin in spins) == (len(spins) % 2)
    level = _hubs(asset)[:: 2 if parameters.coaxial else 1]
    apart = np.linalg.norm(level[:, None] - level[None], axis=-1) + 9 * np.eye(len(level))
    assert apart.min() > 1.98 * multicopter_layout.propeller_radius(parameters)


def test_measures_notice_a_loose_part_and_a_struck_blade():
    asset = _author("research_quad", 0)
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


def test_layouts_place_motors_as_drawn_by_hand():
    base = multicopters.draw_parameters("research_quad", np.random.default_rng(0))
    plain = dataclasses.replace(base, nose_angle=45.0, tail_angle=45.0, arm_rise=0.0)
    half = 0.5 / np.sqrt(2)
    assert multicopter_layout.motor_positions(plain)[:, :2] == pytest.approx(
        np.array([[half, half], [-half, half], [-half, -half], [half, -half]])
    )
    plus = multicopter_layout.motor_positions(dataclasses.replace(plain, layout="plus"))
    assert plus[:, :2] == pytest.approx(np.array([[0.5, 0.0], [0.0, 0.5], [-0.5, 0.0], [0.0, -0.5]]), abs=1e-12)
    rails = multicopter_layout.motor_positions(dataclasses.replace(plain, layout="rails", arms=8))
    assert rails[:, 0] == pytest.approx(half * np.array([1, 1 / 3, -1 / 3, -1, -1, -1 / 3, 1 / 3, 1]))
    raised = dataclasses.replace(plain, rear_rise=0.1, rear_tilt=30.0)
    assert multicopter_layout.motor_positions(raised)[:, 2] == pytest.approx([0.0, 0.1, 0.1, 0.0])
    assert multicopter_layout.motor_axis(raised, (-half, half, 0.1)) == pytest.approx((0.0, -0.5, np.sqrt(0.75)))
    assert multicopter_layout.motor_axis(raised, (half, half, 0.1)) == (0.0, 0.0, 1.0)


def test_propellers_shrink_beside_a_wide_hull_and_only_there():
    base = multicopters.draw_parameters("research_quad", np.random.default_rng(0))
    plain = dataclasses.replace(base, nose_angle=45.0, tail_angle=45.0, arm_rise=0.0, propeller_fill=0.9, hull="box")
    thin = dataclasses.replace(plain, hull_width=0.1, hull_length=0.1)
    assert multicopter_layout.propeller_radius(thin) == pytest.approx(0.9 * np.sqrt(0.5) / 2)
    wide = dataclasses.replace(plain, hull_width=0.6, hull_length=0.5, hull_height=0.3)
    gap = np.hypot(0.5 / np.sqrt(2) - 0.25, 0.5 / np.sqrt(2) - 0.3)
    assert multicopter_layout.propeller_radius(wide) == pytest.approx(0.97 * gap)
    assert multicopter_layout.propeller_radius(dataclasses.replace(wide, arm_rise=0.4)) == pytest.approx(
        0.9 * np.sqrt(0.5) / 2
    )
