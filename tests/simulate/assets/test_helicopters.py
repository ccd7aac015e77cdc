"""Every helicopter family over several draws: closed, one piece, one metre, blades clear of the body and each other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial import cKDTree
from support.rotorcraft_solids import is_closed, loose_pieces, placed, samples, struck_share, triangles

from aerojax.simulate.assets.helicopters import author as helicopters
from aerojax.simulate.assets.helicopters import layout as helicopter_layout
from aerojax.simulate.assets.helicopters.families import FAMILIES, SPLITS
from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.assets.mesh.shapes import frame_along, rotation_about
from aerojax.simulate.usd.authoring import Asset

DRAWS = range(4)
each = pytest.mark.parametrize("family", FAMILIES)
TWO_ROTORS = ("tandem", "coaxial", "synchropter")


def _author(family: str, seed: int) -> Asset:
    rng = np.random.default_rng(seed)
    return helicopters.author(helicopters.draw_parameters(family, rng), rng)


def _main_rotors(asset: Asset) -> list[Part]:
    return [part for part in asset.parts if part.name.startswith("main_rotor")]


def test_sixteen_families_each_in_one_split():
    assert {split: len(names) for split, names in SPLITS.items()} == {"train": 8, "val": 4, "test": 4}
    names = [name for split in SPLITS.values() for name in split]
    assert sorted(names) == sorted(FAMILIES)


@each
def test_solids_are_closed_finite_and_cheap(family):
    for seed in DRAWS:
        asset = _author(family, seed)
        for part in asset.parts:
            assert np.isfinite(part.mesh.points).all()
            assert is_closed(part.mesh), part.name
        assert 1000 <= triangles(asset) <= 6000
        assert max(np.abs(placed(part).points).max() for part in asset.parts) < 1.3


@each
def test_one_piece_whose_rotors_strike_nothing(family):
    for seed in DRAWS:
        asset = _author(family, seed)
        assert loose_pieces(asset) == 1
        assert struck_share(asset) == 0


@each
def test_fuselage_is_one_metre_long_and_rotors_are_above_it(family):
    asset = _author(family, 5)
    fixed = np.concatenate([part.mesh.points for part in asset.parts if part.spin is None])
    assert np.ptp(fixed[:, 0]) == pytest.approx(1.0, abs=1e-9)
    assert fixed[:, 0].max() == pytest.approx(0.5, abs=1e-9)
    cabin = next(part for part in asset.parts if part.name == "cabin").mesh.points
    assert all(rotor.spin.hub[2] > cabin[:, 2].max() for rotor in _main_rotors(asset))
    assert cabin[:, 0].max() > 0.45


def _turned(rotor: Part, seconds: float, lag: float = 0.0) -> np.ndarray:
    turn = rotation_about((0.0, 0.0, 1.0), rotor.spin.phase_degrees + lag + 360.0 * rotor.spin.hertz * seconds)
    blades = samples(rotor.mesh, 0.02)
    blades = blades[np.linalg.norm(blades[:, :2], axis=1) > 0.06]
    return blades @ (frame_along(np.asarray(rotor.spin.axis)) @ turn).T + np.asarray(rotor.spin.hub)


def _closest(asset: Asset, lag: float = 0.0) -> float:
    """Smallest distance between the blades of two rotors over a turn (metres); `lag` spoils their phase."""
    first, second = _main_rotors(asset)
    times = np.linspace(0.0, 1 / abs(first.spin.hertz), 48, endpoint=False)
    return min(
        float(cKDTree(_turned(first, t)).query(_turned(second, t, lag), distance_upper_bound=0.05)[0].min())
        for t in times
    )


@pytest.mark.parametrize("family", TWO_ROTORS)
def test_two_rotors_turn_against_each_other_and_never_meet(family):
    for seed in DRAWS[:2]:
        asset = _author(family, seed)
        first, second = (rotor.spin for rotor in _main_rotors(asset))
        assert first.hertz == -second.hertz
        assert _closest(asset) > 0.008


def test_intermeshing_blades_out_of_step_would_meet():
    assert _closest(_author("synchropter", 0), lag=90.0) < 0.008


def test_masts_of_the_synchropter_lean_apart():
    parameters = helicopters.draw_parameters("synchropter", np.random.default_rng(0))
    left, right = helicopter_layout.hubs(parameters)
    assert left.place[1] == -right.place[1] > 0
    assert np.degrees(np.arctan(left.axis[1])) == pytest.approx(14.0)
    assert right.axis[1] == -left.axis[1]
    assert (left.clockwise, right.clockwise) == (False, True)


def test_tail_rotor_exists_only_where_one_is_named():
    for family in FAMILIES:
        rng = np.random.default_rng(1)
        parameters = helicopters.draw_parameters(family, rng)
        names = [part.name for part in helicopters.author(parameters, rng).parts]
        assert ("tail_rotor" in names) == (parameters.tail_rotor in ("open", "fenestron"))


def test_tailplane_sits_on_the_fin_where_it_should():
    low = helicopters.draw_parameters("executive", np.random.default_rng(0))
    high = {}
    for share in (0.0, 1.0):
        parameters = dataclasses.replace(low, stabiliser_height=share)
        tail = next(p for p in helicopters.author(parameters, np.random.default_rng(0)).parts if p.name == "tail").mesh
        wide = np.abs(tail.points[:, 1]) > 0.3 * low.stabiliser_span
        high[share] = tail.points[wide, 2].mean()
    assert high[1.0] - high[0.0] == pytest.approx(0.97 * low.fin_height, rel=0.2)
