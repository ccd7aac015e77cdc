"""Places of motors and sizes of propellers, by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aerojax.simulate.assets.multicopters import layout as multicopter_layout
from aerojax.simulate.assets.multicopters.families import draw_multicopter


def test_layouts_place_motors_as_drawn_by_hand():
    base = draw_multicopter("research_quad", np.random.default_rng(0))
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
    base = draw_multicopter("research_quad", np.random.default_rng(0))
    plain = dataclasses.replace(base, nose_angle=45.0, tail_angle=45.0, arm_rise=0.0, propeller_fill=0.9, hull="box")
    thin = dataclasses.replace(plain, hull_width=0.1, hull_length=0.1)
    assert multicopter_layout.propeller_radius(thin) == pytest.approx(0.9 * np.sqrt(0.5) / 2)
    wide = dataclasses.replace(plain, hull_width=0.6, hull_length=0.5, hull_height=0.3)
    gap = np.hypot(0.5 / np.sqrt(2) - 0.25, 0.5 / np.sqrt(2) - 0.3)
    assert multicopter_layout.propeller_radius(wide) == pytest.approx(0.97 * gap)
    assert multicopter_layout.propeller_radius(dataclasses.replace(wide, arm_rise=0.4)) == pytest.approx(
        0.9 * np.sqrt(0.5) / 2
    )
