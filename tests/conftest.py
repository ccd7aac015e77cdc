"""Shared fixtures: strict JAX, programs compiled once for all workers, and the data that lies beside the checkout."""

from __future__ import annotations

import gc
import os
import tempfile
from pathlib import Path

import jax
import pytest

SHARED = (Path(__file__).resolve().parents[2] / "shared").resolve()
STRICT = {"jax_debug_nans": True, "jax_numpy_rank_promotion": "raise", "jax_numpy_dtype_promotion": "strict"}


def pytest_configure() -> None:
    """Let all workers, and the processes that tests start, share what XLA compiles."""
    cache = Path(tempfile.gettempdir()) / f"aerojax-tests-{os.getuid()}" / "xla"
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(cache))
    jax.config.update("jax_compilation_cache_dir", os.environ["JAX_COMPILATION_CACHE_DIR"])
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.1")  # writing all small ones costs more here
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)


def pytest_collection_finish() -> None:
    """Leave what was imported and collected out of every later search for garbage, which is most of its time."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _strict_jax():
    for name, value in STRICT.items():
        jax.config.update(name, value)
    yield
    for name, value in {**STRICT, "jax_enable_x64": False}.items():
        jax.config.update(name, value)


@pytest.fixture(autouse=True, scope="module")
def _free_programs():
    """Programs of one file do not stay in memory for the next; what compiled long comes back from the shared cache."""
    yield
    jax.clear_caches()
    gc.collect()


@pytest.fixture
def x64():
    """Double precision for one test."""
    with jax.enable_x64(True):
        yield


@pytest.fixture
def shared() -> Path:
    """The folder of reference data; tests that need it are skipped where it is absent."""
    if not SHARED.is_dir():
        pytest.skip(f"reference data not found at {SHARED}")
    return SHARED
