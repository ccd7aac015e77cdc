"""Commands as processes that are killed at a moment, with everything that they started."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

GRACE = 20.0
"""Seconds that processes may take to notice that their parent is gone."""
TAIL = 2000
"""Characters kept of what a command says."""


@dataclass(frozen=True)
class Ended:
    """How a command ended: its code (None if killed), seconds, and the last of what it said on standard error."""

    code: int | None
    seconds: float
    said: str


def run_command(
    command: Sequence[str],
    *,
    folder: Path,
    environment: Mapping[str, str],
    kill_after: float | None = None,
    whole_group: bool = False,
    limit: float = 1800.0,
) -> Ended:
    """Run a command in a process group of its own, and kill it (SIGKILL) at a moment if it still runs then.

    Args:
        command: program and arguments.
        folder: it runs in.
        environment: added to this process' own.
        kill_after: seconds; None lets it end.
        whole_group: kill what it started at the same instant; else those processes must notice by themselves.
        limit: seconds after which a command that should end is killed.

    Raises:
        TimeoutError: it did not end within `limit`, or processes that it started outlive it by more than `GRACE`.
    """
    begin = time.perf_counter()
    environment = {**os.environ, **environment}
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
        errors="replace",
    )
    try:
        said = process.communicate(timeout=limit if kill_after is None else kill_after)[1]
        return Ended(process.returncode, time.perf_counter() - begin, said[-TAIL:])
    except subprocess.TimeoutExpired:
        (os.killpg if whole_group else os.kill)(process.pid, signal.SIGKILL)
        said = process.communicate()[1]
        if kill_after is None:
            raise TimeoutError(f"{' '.join(command)} did not end within {limit:g} s") from None
        return Ended(None, time.perf_counter() - begin, said[-TAIL:])
    finally:
        _wait_for_group(process.pid)


def _wait_for_group(group: int) -> None:
    end = time.monotonic() + GRACE
    while time.monotonic() < end:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.01)
    os.killpg(group, signal.SIGKILL)
    raise TimeoutError(f"processes of a killed command were there {GRACE:g} s later")
