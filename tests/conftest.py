"""Shared fixtures: strict JAX and the reference data that lies beside the checkout."""

from __future__ import annotations

from pathlib import Path

import jax
import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(autouse=True)
def _strict_jax():
    jax.config.update("jax_debug_nans", True)
    yield
    jax.config.update("jax_debug_nans", True)
    jax.config.update("jax_enable_x64", False)


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
