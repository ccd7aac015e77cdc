"""Statistics of clips, by hand: counts, attributes and motion, whatever the size."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.data.clips import StoredClip
from aerojax.evaluate.dataset_qa.clip_statistics import (
    ClipStatisticsConfig,
    clip_statistics,
    spread_points,
    summary_of,
)

FRAMES, TOKENS = 12, 40


def clip(*, period: int = 4, size: float = 1.0, label: str = "bird", away: float = 10.0) -> StoredClip:
    """A cloud that stretches along z once a period, of Gaussians of one size, every second of them twice."""
    rng = np.random.default_rng(0)
    cloud = np.repeat(rng.normal(size=(TOKENS // 2, 3)), 2, axis=0)
    stretch = 1.0 + 0.5 * np.cos(2 * np.pi * np.arange(FRAMES) / period)
    columns = np.zeros((FRAMES, TOKENS, 14), np.float32)
    columns[..., :3] = size * cloud * np.stack([np.ones(FRAMES), np.ones(FRAMES), stretch], axis=1)[:, None] + 7.0
    columns[..., 3:7] = [np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)]  # 45 degrees
    columns[..., 7:10] = size * np.array([0.1, 0.2, 0.4])
    columns[..., 10] = 0.5
    return StoredClip(columns, label, f"{label}_0", facts={"distance_m": away, "width_px": 30.0})


def test_attributes_of_known_gaussians():
    found = clip_statistics(clip(), 16)
    middle = {name: values[2] for name, values in found.attributes.items()}
    assert middle["anisotropy"] == pytest.approx(4.0, rel=1e-5) and middle["opacity"] == 0.5
    assert middle["angle_deg"] == pytest.approx(45.0, abs=1e-3) and middle["red"] == 0.5
    assert found.gaussians == TOKENS // 2 and found.distance_m == 10.0


def test_size_changes_nothing():
    small, large = clip_statistics(clip(), 16), clip_statistics(clip(size=8.0), 16)
    np.testing.assert_allclose(large.to_first, small.to_first, rtol=1e-4)
    np.testing.assert_allclose(large.attributes["scale"], small.attributes["scale"], rtol=1e-4)


def test_motion_returns_after_its_period():
    found = clip_statistics(clip(period=4), 16)
    assert found.periodic and found.to_first[4] == pytest.approx(0.0, abs=1e-5) and found.to_first[1] > 0.05
    assert int(np.argmax(found.spectrum[1:])) + 1 == FRAMES // 4
    still = clip_statistics(StoredClip(np.repeat(clip().columns[:1], FRAMES, axis=0), "drone", "drone_0"), 16)
    assert not still.periodic and still.to_first.max() < 1e-6 and np.isnan(still.distance_m)


def test_tables_by_class_and_distance():
    several = [clip_statistics(clip(label=name, away=away), 16) for name in ("bird", "drone") for away in (5.0, 150.0)]
    found = summary_of(several, ClipStatisticsConfig())
    assert found["clips"] == 4 and found["identities"] == 2
    rows = {(row["class"], row["from"]): row for row in found["by_distance"]}
    assert set(rows) == {("bird", 0.0), ("bird", 100.0), ("drone", 0.0), ("drone", 100.0)}
    assert rows["bird", 0.0]["strongest_bin"] == 3 and rows["bird", 0.0]["periodic"] == 1.0
    assert {row["attribute"] for row in found["attributes"]} >= {"scale", "opacity", "blue"}
    assert found["gaussians"][0] == {"class": "bird", "quantiles": [20.0] * 5}


def test_farthest_points_are_far():
    line = np.stack([np.arange(10.0), np.zeros(10), np.zeros(10)], axis=1)
    assert spread_points(line, 3)[:, 0].tolist() == [0.0, 9.0, 4.0]
    assert spread_points(line, 20) is line
