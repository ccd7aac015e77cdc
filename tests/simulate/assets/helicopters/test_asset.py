"""Every family of helicopters over several draws: closed, one piece, one metre, blades clear of body and each other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial import cKDTree
from support.rotorcraft_solids import is_closed, loose_pieces, placed, samples, struck_share, triangles

from aerojax.simulate.assets.helicopters.asset import build_helicopter
from aerojax.simulate.assets.helicopters.families import draw_helicopter, helicopter_families
from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.assets.mesh.shapes import frame_along, rotation_about
from aerojax.simulate.usd.authoring import Asset

DRAWS = range(4)


each = pytest.mark.parametrize("family", helicopter_families())


TWO_ROTORS = ("tandem", "coaxial", "synchropter")


def _built(family: str, seed: int) -> Asset:
    rng = np.random.default_rng(seed)
    return build_helicopter(draw_helicopter(family, rng), rng)


def _main_rotors(asset: Asset) -> list[Part]:
    return [part for part in asset.parts if part.name.startswith("main_rotor")]


@each
def test_solids_are_closed_finite_and_cheap(family):
    for seed in DRAWS:
        asset = _built(family, seed)
        for part in asset.parts:
            assert np.isfinite(part.mesh.points).all()
            assert is_closed(part.mesh), part.name
        assert 1000 <= triangles(asset) <= 6000
        assert max(np.abs(placed(part).points).max() for part in asset.parts) < 1.3


@each
def test_one_piece_whose_rotors_strike_nothing(family):
    for seed in DRAWS:
        asset = _built(family, seed)
        assert loose_pieces(asset) == 1
        assert struck_share(asset) == 0


@each
def test_fuselage_is_one_metre_long_and_rotors_are_above_it(family):
    asset = _built(family, 5)
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
        asset = _built(family, seed)
        first, second = (rotor.spin for rotor in _main_rotors(asset))
        assert first.hertz == -second.hertz
        assert _closest(asset) > 0.008


def test_intermeshing_blades_out_of_step_would_meet():
    assert _closest(_built("synchropter", 0), lag=90.0) < 0.008


def test_tail_rotor_exists_only_where_one_is_named():
    for family in helicopter_families():
        rng = np.random.default_rng(1)
        parameters = draw_helicopter(family, rng)
        names = [part.name for part in build_helicopter(parameters, rng).parts]
        assert ("tail_rotor" in names) == (parameters.tail_rotor in ("open", "fenestron"))


def test_tailplane_sits_on_the_fin_where_it_should():
    low = draw_helicopter("executive", np.random.default_rng(0))
    high = {}
    for share in (0.0, 1.0):
        parameters = dataclasses.replace(low, stabiliser_height=share)
        tail = next(p for p in build_helicopter(parameters, np.random.default_rng(0)).parts if p.name == "tail").mesh
        wide = np.abs(tail.points[:, 1]) > 0.3 * low.stabiliser_span
        high[share] = tail.points[wide, 2].mean()
    assert high[1.0] - high[0.0] == pytest.approx(0.97 * low.fin_height, rel=0.2)


def test_tandem_rotors_counter_rotate_in_step():
    built = build_helicopter(draw_helicopter("tandem", np.random.default_rng(0)), np.random.default_rng(1))
    first, second = [p.spin for p in built.parts if p.spin is not None]
    assert first.hertz == -second.hertz
    assert abs(first.hub[0] - second.hub[0]) > 0.6
