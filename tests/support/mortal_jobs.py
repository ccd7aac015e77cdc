"""A job at which its process dies, for workers that must survive it."""

from __future__ import annotations

import os
import signal
from pathlib import Path


def squared_or_dead(job: tuple[Path, int]) -> int:
    """Dies the first time at 1, always at 3."""
    folder, number = job
    with (folder / str(number)).open("a") as tried:
        tried.write("x")
    if number == 3 or (number == 1 and (folder / "1").read_text() == "x"):
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number
