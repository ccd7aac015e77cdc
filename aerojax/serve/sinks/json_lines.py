"""Messages as lines of JSON, on standard output or at the end of a file."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path
from typing import BinaryIO

from aerojax.core.files import json_text
from aerojax.serve.figures import Health
from aerojax.serve.messages import Message, Sighting

_LONGEST = 1 << 20
"""Bytes in which the last line's beginning is looked for."""


class LineFile:
    """Lines at the end of a file, or of standard output, each written at once and whole.

    What a killed process left of a file's last line is cut off, so that every line can be read.

    Args:
        path: of the file, which is made if it is not there; None is standard output, which stays open.
    """

    def __init__(self, path: Path | None) -> None:
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            _mend(path)
        self._file: BinaryIO = sys.stdout.buffer if path is None else path.open("ab", buffering=0)
        self._own, self._broken = path is not None, False

    def write(self, text: str) -> None:
        """Add a line; a line feed follows the text.

        Raises:
            OSError: it could not be written.
        """
        line = text.encode() + b"\n"
        line = b"\n" + line if self._broken else line  # a full disk took a part of the last one
        self._broken = True
        try:
            if self._file.write(line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self._file.flush()
        except BrokenPipeError:
            # Nobody reads any more; what is buffered would be tried again, and fail again, when Python ends.
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._file.fileno())
            raise
        self._broken = False

    def close(self) -> None:
        """Close a file."""
        if self._own:
            self._file.close()


class JsonLines:
    """The messages as they are."""

    name, vital = "output", True

    def __init__(self, path: Path | None) -> None:
        self._file = LineFile(path)

    def send(self, message: Message, sighting: Sighting | None) -> None:
        """Write a line."""
        self._file.write(json_text(message, indent=None).rstrip("\n"))

    def see(self, health: Health) -> None:
        """Figures go with the messages that tell them."""

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _mend(path: Path) -> None:
    """Cut off a last line that does not end."""
    if not path.exists() or path.stat().st_size == 0:
        return
    with path.open("r+b") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - _LONGEST, 0))
        tail = file.read()
        if not tail.endswith(b"\n"):
            file.truncate(size - len(tail) + tail.rfind(b"\n") + 1)
