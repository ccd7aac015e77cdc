"""USD files from elsewhere: this process reads a copy that USD wrote itself, never their own bytes.

USD's readers trust a file: a damaged one can end the process that reads it, or spoil its memory so that it ends later.
So a process of its own composes such a file and writes it anew, and only that copy is opened here. It costs 0.2 s and
the time to read and write the file.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerojax.core import usd_flatten
from aerojax.core.errors import UserError
from aerojax.core.files import temporary_file

PREFIX = "aerojax_usd_"
"""How the names of copies begin, in the system's folder for temporary files."""
PATIENCE = 10
"""Wall-clock seconds granted for each second of processor time, on a busy machine."""


@dataclass(frozen=True)
class UsdCopy:
    """A flattened copy: its path, and the kind (name of its class in Pcp) and words of each arc that leads nowhere."""

    path: Path
    broken: tuple[tuple[str, str], ...]


@contextmanager
def usd_copy(path: Path) -> Iterator[UsdCopy]:
    """A copy of a USD file and of all that it refers to, in one flattened layer that lasts as long as the block.

    Metadata of the stage, time samples and the places of textures are those of the file; what it composes from other
    files stands in the copy itself, and native instances are plain prims.

    Args:
        path: an existing file.

    Raises:
        UserError: it is no USD file, a value in it cannot be read, reading it ends the USD library or takes far longer
            or more memory than a file of its size should, or there is no place for the copy.
    """
    with temporary_file(PREFIX, ".usdc") as copy:
        yield UsdCopy(copy, _flattened(path, copy))


def is_flattening(command: Sequence[object]) -> bool:
    """Whether a command line is the one that `usd_copy` runs."""
    return list(map(str, command[: len(_command())])) == _command()


def _command() -> list[str]:
    return [sys.executable, "-P", "-B", usd_flatten.__file__]


def _flattened(path: Path, copy: Path) -> tuple[tuple[str, str], ...]:
    seconds = usd_flatten.SECONDS + path.stat().st_size // usd_flatten.BYTES_A_SECOND
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    try:
        ended = subprocess.run(
            [*_command(), str(path), str(copy)],
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=PATIENCE * seconds,
        )
    except subprocess.TimeoutExpired:
        raise _endless(path, PATIENCE * seconds) from None
    if ended.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        raise _endless(path, seconds)
    if ended.returncode < 0:
        name = signal.Signals(-ended.returncode).name
        raise UserError("unreadable", f"{path}: is damaged: reading it crashes the USD library ({name})", _REMEDY)
    if ended.returncode > 0:
        raise RuntimeError(ended.stderr.decode(errors="replace")[-2000:])
    return _told(path, json.loads(ended.stdout))


def _told(path: Path, answer: dict[str, Any]) -> tuple[tuple[str, str], ...]:
    match answer.get("refused"):
        case None:
            return tuple((kind, words) for kind, words in answer["broken"])
        case "unreadable":
            raise UserError("unreadable", f"{path} is not a readable USD file", _REMEDY)
        case _:
            raise UserError("unreadable", f"{path}: cannot be flattened ({answer['why']})", _REMEDY)


def _endless(path: Path, seconds: int) -> UserError:
    return UserError(
        "out-of-range", f"{path}: USD did not read it within {seconds} s", "simplify it or export it again"
    )


_REMEDY = "export it again"
