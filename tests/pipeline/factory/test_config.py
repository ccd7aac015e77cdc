"""Ranges: what they refuse, and what is drawn from them."""

from __future__ import annotations

import numpy as np
import pytest
from support.factory_configs import small_factory

from aerojax.core.errors import UserError
from aerojax.pipeline.factory.config import FaultRanges, RigRanges, draw_fault, draw_whole_fault, log_uniform


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"rigs": RigRanges(width_px=(50.0, 40.0))}, "width_px is 50.0 to 40.0"),
        ({"rigs": RigRanges(cameras=(2, 4))}, "rigs.cameras is 2 to 4"),
        ({"rigs": RigRanges(cameras=(3, 9))}, "rigs.cameras is 3 to 9"),
        ({"rigs": RigRanges(kinds=("ring",))}, "choose of sphere, circle, line, free"),
        ({"faults": FaultRanges(mask_growth=(1, -1))}, "mask_growth is 1 to -1"),
        ({"least_frames": 3}, "least_frames 3"),
        ({"clips": 0}, "clips 0"),
    ],
)
def test_impossible_ranges_are_refused(change, named):
    with pytest.raises(UserError, match=named):
        small_factory(**change)


def test_equal_ends_fix_a_fault_and_a_range_with_zero_often_gives_none():
    rng = np.random.default_rng(0)
    assert {draw_fault(rng, (1.0, 1.0), 0.5) for _ in range(20)} == {1.0}
    assert {draw_whole_fault(rng, (-2, -2), 0.5) for _ in range(20)} == {-2}
    drawn = np.array([draw_fault(rng, (0.0, 0.3), 0.5) for _ in range(400)])
    assert 0.4 < np.mean(drawn == 0.0) < 0.6 and drawn.max() <= 0.3 and drawn.max() > 0.27
    whole = [draw_whole_fault(rng, (-1, 1), 0.4) for _ in range(400)]
    assert set(whole) == {-1, 0, 1} and 0.5 < np.mean(np.array(whole) == 0) < 0.7  # 0.4 + 0.6 / 3


def test_a_logarithmic_draw_has_its_median_at_the_geometric_mean():
    rng = np.random.default_rng(0)
    drawn = [log_uniform(rng, (1.0, 100.0)) for _ in range(2000)]
    assert np.median(drawn) == pytest.approx(10.0, rel=0.15)
