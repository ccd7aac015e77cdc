"""Files that a reader never sees half of, and their hashes."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from aerojax.core.errors import UserError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to; it takes its place when the block ends without an exception.

    Several processes may write the same file at once: each has a temporary file of its own, and the last one stays.
    A killed process leaves at most a hidden temporary file. Folders on the way are made.

    Args:
        path: of the file; its suffix is kept, for writers that look at it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=f".tmp{path.suffix}")
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


@contextmanager
def temporary_file(prefix: str, suffix: str) -> Iterator[Path]:
    """An empty file in the system's folder for temporary files, which is gone when the block ends."""
    handle, name = tempfile.mkstemp(prefix=prefix, suffix=suffix)
    os.close(handle)
    try:
        yield Path(name)
    finally:
        Path(name).unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file whole or not at all."""
    write_bytes(path, text.encode())


def write_json(path: Path, content: Any, *, indent: int | None = 1) -> None:
    """Write JSON whole or not at all; see `json_text`."""
    try:
        text = json_text(content, indent=indent)
    except ValueError:
        raise UserError("invalid", f"{path}: a number to write is NaN or infinite", "check its source") from None
    write_text(path, text)


def json_text(content: Any, *, indent: int | None = 1) -> str:
    """JSON as all files here have it.

    Raises:
        ValueError: a number is not finite, which JSON has no word for.
    """
    return json.dumps(content, indent=indent, ensure_ascii=False, allow_nan=False) + "\n"


def fingerprint(*parts: bytes) -> str:
    """A short hash of contents by which to know them again: 16 bytes of BLAKE2b (RFC 7693), in hexadecimal."""
    return hashlib.blake2b(b"".join(parts), digest_size=16).hexdigest()


def sha256_of_text(text: str) -> str:
    """SHA-256 of a UTF-8 file with this text, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def sha256_of_file(path: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal; read in pieces, so that large files need no memory."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
