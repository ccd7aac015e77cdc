"""What a command leaves on disk, without what its formats state as time, speed or place."""

from __future__ import annotations

import json
from collections.abc import Mapping
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from aerojax.core.files import fingerprint

VOLATILE = frozenset(
    {
        *("date", "seconds", "minutes", "images_per_s", "clips_per_s", "simulate", "cast", "write"),
        *("new", "made", "images_written", "clips_made", "commit", "commits"),
    }
)
"""Keys of JSON that state when, how fast, with which checkout, and how much this call did and not an earlier one."""
UNFINISHED = (".*", "*.partial", "*.orbax-checkpoint-tmp*", "*.crswap")
"""Names, of files or of folders above them, that say that what they hold is not whole."""
FOREIGN = ("hydra", "multirun.yaml")
"""What Hydra writes anew at each start."""
BROKEN = "broken"
"""The mark of a file of JSON, or of weights, that cannot be read."""


def marks(folder: Path, *, ignoring: tuple[str, ...] = ()) -> dict[str, str]:
    """A hash of every finished file by its path from `folder`; equal for files that differ in `VOLATILE` keys alone.

    Args:
        folder: what was written.
        ignoring: patterns of further paths that are left out.
    """
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        unfinished = any(fnmatch(part, pattern) for part in name.parts for pattern in (*UNFINISHED, *FOREIGN))
        if path.is_file() and not unfinished and not any(fnmatch(str(name), pattern) for pattern in ignoring):
            found[str(name)] = _mark(path)
    return found


def _mark(path: Path) -> str:
    content = path.read_bytes()
    try:
        if path.suffix == ".json":
            return fingerprint(_lasting_text(content))
        if path.suffix == ".safetensors":
            end = 8 + int.from_bytes(content[:8], "little")
            return fingerprint(_lasting_text(content[8:end]), content[end:])
    except ValueError:
        return BROKEN
    return fingerprint(content)


def _lasting_text(content: bytes) -> bytes:
    return json.dumps(_lasting(json.loads(content)), sort_keys=True).encode()


def _lasting(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _lasting(item) for key, item in value.items() if key not in VOLATILE}
    if isinstance(value, str) and value.startswith("{"):  # JSON within the header of weights
        return _lasting(json.loads(value))
    return [_lasting(item) for item in value] if isinstance(value, list) else value


def differences(found: Mapping[str, str], wanted: Mapping[str, str]) -> tuple[str, ...]:
    """What is wrong with a finished output beside one that nothing disturbed: names of files, and how they differ."""
    changed = [f"{name} differs" for name in sorted(found.keys() & wanted.keys()) if found[name] != wanted[name]]
    missing = [f"{name} is missing" for name in sorted(wanted.keys() - found.keys())]
    return (*changed, *missing, *(f"{name} is too much" for name in sorted(found.keys() - wanted.keys())))


def halves(found: Mapping[str, str], wanted: Mapping[str, str], growing: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Files of an unfinished output that stand under their final names without their final content.

    Args:
        found: marks of what a kill left.
        wanted: marks of the whole output.
        growing: patterns of files that are replaced as the work goes on, whole each time: only broken ones count.
    """
    wrong = []
    for name, mark in sorted(found.items()):
        replaced = any(fnmatch(name, pattern) for pattern in growing)
        if mark == BROKEN or (not replaced and mark != wanted.get(name)):
            wrong.append(name)
    return tuple(wrong)
