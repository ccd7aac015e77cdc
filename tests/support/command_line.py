"""Run an experiment's `main` as its command line does, inside the test's process."""

from __future__ import annotations

import logging
import sys
from types import ModuleType

import pytest


def run_command(act: ModuleType, patch: pytest.MonkeyPatch, *arguments: str) -> None:
    """Call `act.main` with `arguments` as its command line.

    Hydra's logging set-up shuts every handler down; one of them, made while tests are collected, holds the stream that
    pytest captures to and would close it. Training would keep all memory that it frees until its process ends, which
    here goes on with other tests; tests/training/test_memory.py holds that in processes of its own.
    """
    patch.setattr(logging, "shutdown", lambda *handlers: None)
    patch.setattr("experiments._launch.classifier_training.keep_freed_memory", lambda: False)
    patch.setattr(sys, "argv", [f"{act.__name__.rsplit('.', 1)[-1]}.py", *arguments])
    act.main()
