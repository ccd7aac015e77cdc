"""Hubs of helicopters, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.simulate.assets.helicopters import layout as helicopter_layout
from aerojax.simulate.assets.helicopters.families import draw_helicopter


def test_masts_of_the_synchropter_lean_apart():
    parameters = draw_helicopter("synchropter", np.random.default_rng(0))
    left, right = helicopter_layout.hubs(parameters)
    assert left.place[1] == -right.place[1] > 0
    assert np.degrees(np.arctan(left.axis[1])) == pytest.approx(14.0)
    assert right.axis[1] == -left.axis[1]
    assert (left.clockwise, right.clockwise) == (False, True)
