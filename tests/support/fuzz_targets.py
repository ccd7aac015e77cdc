"""Readers that misbehave in every way that the fuzzer must notice; functions of a module, since workers import them."""

from __future__ import annotations

import os
import pickle
import time
from pathlib import Path

from aerojax.core.errors import UserError


def read_or_misbehave(folder: Path) -> None:
    """What the file's first byte says; the seed's is `0`."""
    content = (folder / "a.bin").read_bytes()
    match content[:1]:
        case b"r":
            raise UserError("invalid", "no", "")
        case b"s":
            raise UserError("invalid", " ", "")
        case b"t":
            raise KeyError("x")
        case b"m":
            bytes(1 << 45)
        case b"h":
            time.sleep(60)
        case b"c":
            os.abort()
        case b"w":
            (folder / "left").touch()
        case b"d":
            (folder.parent / "outside").mkdir(exist_ok=True)
        case b"p":
            pickle.loads(b"cos\ngetpid\n.")
