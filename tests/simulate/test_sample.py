"""The sample capture: its defaults, its name, made once, refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from aerojax.core.errors import UserError
from aerojax.simulate import sample
from aerojax.simulate.sample import SampleConfig, sample_capture


def test_a_sample_is_made_once(tmp_path, monkeypatch):
    made: list[tuple[str, int]] = []

    def simulate(identity, config, *, seed: int, folder: Path, assets: Path) -> None:
        folder.mkdir(parents=True)
        (folder / "capture.json").write_text("{}")
        made.append((identity.name, seed))

    monkeypatch.setattr(sample, "simulate_sequence", simulate)
    config = SampleConfig(folder=tmp_path)
    first, again = (sample_capture(config, tmp_path / "assets") for _ in range(2))
    assert first == again == tmp_path / "drone_dead_cat_00_seed3_24frames"
    outlier = sample_capture(SampleConfig(label="ball", seed=1, folder=tmp_path), tmp_path / "assets")
    assert outlier == tmp_path / "ball_outlier_001_seed1_24frames"
    assert made == [("drone_dead_cat_00", 3), ("ball_outlier_001", 1)]


def test_an_unknown_class_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"sample.label=ufo is no class.*bird, drone, airplane, helicopter, ball, box"):
        sample_capture(SampleConfig(label="ufo", folder=tmp_path), tmp_path)
