"""A loop of frames goes on in number and time, and growth over a stream is told."""

from __future__ import annotations

import pytest

from aerojax.core.types import FrameSet
from aerojax.pipeline.soak import Soaked, SoakWindow, looped
from experiments._soak.growth import figures_of


def test_a_loop_goes_on():
    frames = [FrameSet(frame=n, time_s=n / 30, rgb=(), ids=()) for n in range(3)]
    found = list(looped(frames, 7, 30.0))
    assert [one.frame for one in found] == list(range(7))
    assert found[6].time_s == pytest.approx(0.2)


@pytest.mark.parametrize(("leak", "per_10000"), [(0.0, 0.0), (0.5, 5.0)])
def test_growth_is_told(leak, per_10000):
    windows = tuple(SoakWindow(1000 * n, 5.0, 6.0, 100.0 + leak * n, 9, 2) for n in range(1, 11))
    figures = figures_of(Soaked(windows, 10_000, 10_000, 800, 1e-6, 1e-7))
    assert figures["growth_in_10000_frames"]["resident_mb"] == pytest.approx(per_10000, abs=1e-9)
    assert figures["growth_in_10000_frames"]["step_ms"] == pytest.approx(0.0, abs=1e-9)
    assert figures["windows"][0]["frames"] == 1000 and figures["drift"] == 1e-6
