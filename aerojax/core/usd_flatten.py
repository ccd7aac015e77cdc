"""A program of its own: compose a USD file, flatten it and write it anew; `usd_copies` runs it.

It imports USD and nothing else, so that it starts in a fifth of a second, and answers on standard output in JSON: what
could not be composed, or why nothing was written. A file that makes the USD library crash ends this process alone.
"""

from __future__ import annotations

import json
import os
import resource
import sys
from pathlib import Path

from pxr import Tf, Usd

BYTES_A_SECOND = 1_000_000
"""Slower than any right file is flattened."""
SECONDS = 30
"""Of processor time, besides those for the file's size; a right file of a few kilobytes takes 0.2."""
MEGABYTES = 8192
"""Of address space, besides `COPIES` times the file's size: USD reserves about one gigabyte before it reads."""
COPIES = 64
"""A compressed file's values may be so many times its size."""


def flatten(source: str, target: str) -> dict[str, object]:
    """Write everything that a file composes, native instances as plain prims, to another file.

    Returns:
        What to tell: `refused` ("unreadable" or "damaged") and why, if nothing was written; else `broken`,
        the kind and the words of each arc that leads nowhere.
    """
    try:
        stage = Usd.Stage.Open(source)
    except Tf.ErrorException as error:
        return {"refused": "unreadable", "why": _last_line(error)}
    broken = [(type(error).__name__, _words(error)) for error in stage.GetCompositionErrors()]
    try:
        while instances := [prim for prim in stage.TraverseAll() if prim.IsInstance()]:
            for prim in instances:
                prim.SetInstanceable(False)
        stage.Flatten(False).Export(target)
    except (Tf.ErrorException, MemoryError) as error:
        return {"refused": "damaged", "why": _last_line(error)}
    return {"broken": broken}


def _last_line(error: Exception) -> str:
    return (_words(error).strip().splitlines() or [type(error).__name__])[-1].strip()


def _words(error: object) -> str:
    """What USD says, which quotes the file's bytes, whatever they are."""
    try:
        return str(error)
    except UnicodeDecodeError:
        return type(error).__name__


def _bound(kind: int, value: int) -> None:
    """Lower a limit of this process, never raise one."""
    hard = resource.getrlimit(kind)[1]
    most = value if hard == resource.RLIM_INFINITY else min(value, hard)
    resource.setrlimit(kind, (most, most))


def main() -> None:
    """Arguments: the file to read and the one to write."""
    source, target = sys.argv[1:]
    answer = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # nothing that a library prints may come between
    size = Path(source).stat().st_size
    _bound(resource.RLIMIT_CPU, SECONDS + size // BYTES_A_SECOND)
    _bound(resource.RLIMIT_AS, MEGABYTES * 2**20 + COPIES * size)
    with answer:
        json.dump(flatten(source, target), answer)


if __name__ == "__main__":
    main()
