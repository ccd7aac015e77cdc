"""Tails of birds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerojax.simulate.assets.birds import bodies as bird_bodies
from aerojax.simulate.assets.birds.families import draw_bird


@pytest.mark.parametrize("tail", bird_bodies.TAILS)
def test_tails_keep_their_width_and_length(tail):
    shape = replace(
        draw_bird("gull", np.random.default_rng(0)).shape, tail=tail, tail_length=0.3, tail_width=0.2, body_width=0.1
    )
    points = bird_bodies.tail(shape).points
    longest = float(np.max(bird_bodies.TAILS[tail](np.linspace(0, 1, 50))))
    assert shape.rump - points[:, 0].min() == pytest.approx(0.3 * longest, rel=0.12)
    edge = float(bird_bodies.TAILS[tail](np.ones(1))[0])
    if edge > 0.9:
        assert np.ptp(points[:, 1]) == pytest.approx(0.2, rel=0.1)
