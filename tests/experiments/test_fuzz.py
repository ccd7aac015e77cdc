"""Every input is read as it is, and a few hundred changed ones end in an answer or a refusal by name."""

from __future__ import annotations

import math
import sys

import jax
import pytest

from aerojax.evaluate.fuzz.workers import changed_files, run_case
from experiments._fuzz.targets import TARGETS, make_targets

QUICK = ("ply", "compressed_ply", "usd_splats", "pt", "clip", "manifest", "config", "models", "capture")
QUICK += ("gltf", "mesh", "obj", "usd", "colmap", "nerfstudio", "opencv", "kalibr", "projections", "drone_tracking")
"""Formats that take some milliseconds a file; the weights and videos of the others are left to the act."""
CASES = 40
FEW = 8
"""Cases of USD, each of which starts a process."""


@pytest.fixture(autouse=True)
def _no_caches(monkeypatch):
    """A compiled program or module that is kept on disk would pass for a file that a reader wrote."""
    kept = jax.config.jax_persistent_cache_min_compile_time_secs
    # Not the folder: once a program was compiled, a cache is open that its change does not close.
    jax.config.update("jax_persistent_cache_min_compile_time_secs", math.inf)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield
    jax.config.update("jax_persistent_cache_min_compile_time_secs", kept)


@pytest.mark.parametrize("name", QUICK)
def test_changed_files_are_read_or_refused(name, tmp_path):
    target, cases = make_targets([name])[name], FEW if name.startswith("usd") else CASES
    with jax.debug_nans(False):
        for files in target.seeds:
            assert run_case(target, files, tmp_path / "case") == ("read", "")  # the first also compiles and imports
        ended = {
            case: run_case(target, changed_files(target, name, 1, case), tmp_path / "case") for case in range(cases)
        }
    wrong = {case: outcome for case, outcome in ended.items() if outcome[0] not in ("read", "refused")}
    assert not wrong, f"only=[{name}] seed=1: {wrong}"
    assert sum(outcome[0] == "refused" for outcome in ended.values()) > cases // 5


def test_every_format_has_a_weight():
    assert set(QUICK) < set(TARGETS)
