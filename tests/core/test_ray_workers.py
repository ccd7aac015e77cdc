"""Jobs on a Ray cluster of this machine: results as they come, actors that are killed, Ray that is not there."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import pytest
from support.mortal_jobs import squared_or_dead

from aerojax.core.errors import UserError
from aerojax.core.ray_workers import ATTEMPTS, require_ray, run_on_ray

TESTS = Path(__file__).resolve().parents[1]
HAS_RAY = importlib.util.find_spec("ray") is not None


@pytest.mark.skipif(HAS_RAY, reason="Ray is installed")
def test_without_ray_it_says_what_to_install():
    with pytest.raises(UserError, match="pip install 'aerojax\\[cluster\\]'"):
        list(run_on_ray(squared_or_dead, [], workers=1))


@pytest.mark.slow
@pytest.mark.skipif(not HAS_RAY, reason="Ray is not installed; it comes with the extra `cluster`")
@pytest.mark.filterwarnings("ignore")
def test_what_a_killed_actor_was_at_is_done_again(tmp_path, monkeypatch):
    monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(map(str, (TESTS, TESTS.parent))))  # where actors find the job
    require_ray()
    found = dict(run_on_ray(squared_or_dead, [(tmp_path, n) for n in range(6)], workers=2))
    assert found == {0: 0, 1: 1, 2: 4, 3: None, 4: 16, 5: 25}
    assert len((tmp_path / "3").read_text()) == ATTEMPTS
