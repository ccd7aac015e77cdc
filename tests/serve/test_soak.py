"""Figures of a service are kept once a window."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from aerojax.serve.figures import Figures
from aerojax.serve.messages import message
from aerojax.serve.soak import SoakSink

GIVEN = {"cameras": {}, "partial": 0, "dropped": 0, "waiting": 0, "tracks": 2, "stages_ms": {}, "failed_sends": {}}


def test_figures_are_kept_once_a_window():
    figures, told = Figures(), []
    sink = SoakSink(40, 4, lambda *step: told.append(step))
    for frame in range(1, 41):
        figures.frame(0.001 * frame)
        if frame in (3, 25):
            sink.send(message("appeared", datetime.now(UTC), frame=frame, time_s=0.0, track=frame), None)
        sink.send(message("lost", datetime.now(UTC), frame=frame, time_s=0.0, track=frame), None)
        if frame in (9, 12, 13, 25, 40):  # figures are looked at now and then
            sink.see(figures.health(**GIVEN))
    assert [(window.frames, window.begun, window.tracks) for window in sink.windows] == [
        (12, 1, 2),
        (25, 2, 2),
        (40, 2, 2),
    ]
    assert [window.latency_ms for window in sink.windows] == pytest.approx([6.5, 13.0, 20.5])
    assert all(window.step_ms > 0 and window.resident_mb > 1 and window.handles > 0 for window in sink.windows)
    assert told == [(12, 40, "frames"), (25, 40, "frames"), (40, 40, "frames")]
