"""Files that a model names, looked for where they may lie."""

from __future__ import annotations

from pathlib import Path


def find_beside(folder: Path, name: str) -> Path | None:
    """The file that a statement names: with either slash, in the folder itself if its path is another machine's.

    Nothing outside the folder is found, be it by an absolute path, by `..` or over a link: a model from elsewhere could
    have any file copied into what is made of it. Names whose bytes are no UTF-8 are looked for in the encoding of
    Western Windows too, and in either case.
    """
    try:
        raw = name.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:  # half a letter: no file has that name
        return None
    spelled = [name]
    if name != raw.decode("utf-8", "replace"):
        spelled.append(raw.decode("cp1252", "replace"))
    for word in [w.strip().strip('"') for w in spelled]:
        slashed = word.replace("\\", "/")
        for candidate in (word, slashed, slashed.rpartition("/")[2]):
            if candidate and _is_file_of(folder, folder / candidate):
                return folder / candidate
        last = slashed.rpartition("/")[2].lower()
        if found := [p for p in sorted(folder.iterdir()) if p.name.lower() == last and _is_file_of(folder, p)]:
            return found[0]
    return None


def _is_file_of(folder: Path, path: Path) -> bool:
    try:
        return path.is_file() and path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # longer than a name can be, with a zero byte, links in a circle
        return False
