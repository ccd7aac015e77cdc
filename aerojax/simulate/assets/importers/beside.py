"""Files that a model names, looked for where they may lie."""

from __future__ import annotations

from pathlib import Path


def find_beside(folder: Path, name: str) -> Path | None:
    """The file that a statement names: with either slash, in the folder itself if its path is another machine's.

    Names whose bytes are no UTF-8 are looked for in the encoding of Western Windows too, and in either case.
    """
    spelled = [name]
    if name != (raw := name.encode("utf-8", "surrogateescape")).decode("utf-8", "replace"):
        spelled.append(raw.decode("cp1252", "replace"))
    for word in [w.strip().strip('"') for w in spelled]:
        slashed = word.replace("\\", "/")
        for candidate in (word, slashed, slashed.rpartition("/")[2]):
            if candidate and _is_file(folder / candidate):
                return folder / candidate
        last = slashed.rpartition("/")[2].lower()
        if found := [p for p in sorted(folder.iterdir()) if p.name.lower() == last and _is_file(p)]:
            return found[0]
    return None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # longer than a name can be, or with a zero byte
        return False
