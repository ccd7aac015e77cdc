"""Pieces of path in single cameras, and offsets of clocks from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.flights import path, ring, watch

from aerojax.track.adjust.clock_search import search_offsets
from aerojax.track.adjust.tracklets import tracklets


def test_pieces_follow_what_moves_and_leave_out_what_does_not_go_on():
    rng = np.random.default_rng(0)
    stamps = np.arange(30) / 30
    one = np.stack([100 + 300 * stamps, 200 - 90 * stamps], axis=1)
    other = np.stack([400 - 300 * stamps, 212 - 90 * stamps], axis=1)  # they cross
    false = rng.uniform(0, 500, (30, 2))
    order = rng.permutation(90)
    found = tracklets(np.tile(stamps, 3)[order], np.concatenate([one, other, false])[order])
    assert sorted(set((order[rows] // 30).tolist()).pop() for rows in found) == [0, 1]
    assert all(np.all(np.diff(np.tile(stamps, 3)[order][rows]) > 0) for rows in found)
    assert tracklets(np.zeros(0), np.zeros((0, 2))) == []


def test_offsets_are_found_to_a_few_hundredths():
    rng = np.random.default_rng(3)
    given = ring(4, seed=3)
    wrong = np.array([0.0, 0.17, -0.12, 0.2])
    true = tuple(replace(c, time_offset_s=o) for c, o in zip(given, wrong.tolist(), strict=True))
    seen = watch([path(rng)], true, seconds=8.0, rng=rng, stagger=True)
    assert search_offsets(seen.detections, given, 0.3) == pytest.approx(wrong, abs=0.025)
    assert search_offsets(seen.detections, true, 0.3) == pytest.approx(np.zeros(4), abs=0.025)


def test_without_detections_nothing_is_changed():
    given = ring(3)
    seen = watch([path(np.random.default_rng(0))], given, seconds=1.0, rng=np.random.default_rng(0), missed=1.0)
    assert search_offsets(seen.detections.chosen(np.zeros(0, np.int64)), given, 0.2).tolist() == [0, 0, 0]
