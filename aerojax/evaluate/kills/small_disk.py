"""A disk of a few kilobytes in memory, where the system lets this process mount one."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

PAGE = 4096
"""Bytes that the smallest file takes."""


@dataclass(frozen=True)
class SmallDisk:
    """A mounted tmpfs."""

    folder: Path

    def grow(self, size: int) -> None:
        """Make it hold `size` bytes."""
        _mount("remount", f"size={size}", self.folder)

    def forbid_writing(self) -> None:
        """Nobody may write to it any more, whatever its permissions say."""
        _mount("remount", "ro", self.folder)


def _mount(*options: str | Path) -> bool:
    *words, folder = options
    command = ["mount", "-t", "tmpfs", "-o", ",".join(map(str, words)), "tmpfs", str(folder)]
    try:
        return subprocess.run(command, capture_output=True).returncode == 0
    except OSError:
        return False


@contextmanager
def small_disk(folder: Path, size: int) -> Iterator[SmallDisk | None]:
    """Mount a disk of `size` bytes on `folder`, which is made; None where that is not allowed."""
    folder.mkdir(parents=True, exist_ok=True)
    if not _mount(f"size={max(size, 4 * PAGE)}", folder):
        yield None
        return
    try:
        yield SmallDisk(folder)
    finally:
        for options in ((), ("--lazy",)):  # a file that is still open holds it: it goes when that is closed
            if subprocess.run(["umount", *options, str(folder)], capture_output=True).returncode == 0:
                break
