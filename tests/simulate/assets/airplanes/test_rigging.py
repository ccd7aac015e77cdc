"""What hangs on an airplane: floats, and the keel of an ultralight."""

from __future__ import annotations

from support.airplanes import built_airplane, part_points


def test_floats_hang_below_everything_and_carry_the_balance_point():
    asset = built_airplane("floatplane")
    floats, wings = part_points(asset, "floats"), part_points(asset, "wings")
    assert floats[:, 2].min() < min(part_points(asset, n)[:, 2].min() for n in ("fuselage", "wings", "tail"))
    assert floats[:, 0].min() < wings[:, 0].mean() < floats[:, 0].max()


def test_an_ultralight_hangs_its_seat_under_the_wing_and_its_tail_on_the_keel():
    asset = built_airplane("ultralight")
    fuselage, wings, tail = (part_points(asset, n) for n in ("fuselage", "wings", "tail"))
    assert fuselage[:, 2].max() < wings[:, 2].min()
    assert fuselage[:, 0].min() > tail[:, 0].max()
    assert part_points(asset, "keel")[:, 0].min() < tail[:, 0].max()
