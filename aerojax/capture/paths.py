"""File patterns of a capture: parsed by regular expression, never by `str.format`.

They stay within the capture's folder, unless the capture says that its files lie elsewhere (`outside`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path, PureWindowsPath

from aerojax.core.errors import UserError
from aerojax.core.seeds import number_of

VIDEO_SUFFIXES = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v")
RGB_SUFFIXES = (".png", ".jpg", ".jpeg")
FLOAT_SUFFIXES = (".tiff", ".tif")
PNG_SUFFIXES = (".png",)
MASK_SUFFIXES = (*RGB_SUFFIXES, *FLOAT_SUFFIXES)

_LONGEST_PATH = 240  # bytes; what every file system takes as one name
_HASH_DIGITS = 8
_PATTERN = re.compile(r"(?P<head>[^{}]*)\{frame(?::0(?P<digits>[1-9]|1[0-9])d)?\}(?P<tail>[^{}]*)")


def is_video(pattern: str) -> bool:
    """Whether `rgb` names one video file rather than a file a frame."""
    return "{" not in pattern and pattern.lower().endswith(VIDEO_SUFFIXES)


def pattern_problem(
    pattern: str, suffixes: tuple[str, ...], *, video: bool = False, outside: bool = False
) -> str | None:
    """What is wrong with a file pattern, or None.

    Args:
        pattern: relative path with exactly one `{frame}` or `{frame:0Nd}`.
        suffixes: lower-case file endings that this kind of file may have.
        video: whether one video file may stand instead of the pattern.
        outside: whether it may be absolute or lead out of the capture's folder.
    """
    if problem := path_problem(pattern, outside=outside):
        return problem
    if video and is_video(pattern):
        return None
    if not _PATTERN.fullmatch(pattern):
        return "must contain exactly one {frame} or {frame:0Nd} and no other braces"
    if not pattern.lower().endswith(suffixes):
        return f"must end in {' or '.join(suffixes + (VIDEO_SUFFIXES if video else ()))}"
    return None


def relative_path_problem(path: str) -> str | None:
    """Why a path of a capture could leave its folder, or None; reads nothing from the disk."""
    return path_problem(path, outside=False)


def path_problem(path: str, *, outside: bool) -> str | None:
    """What is wrong with a path of a capture, or None; reads nothing from the disk.

    Args:
        path: relative to the capture's folder.
        outside: whether it may be absolute or lead out of that folder.
    """
    parts = path.replace("\\", "/").split("/")
    if not outside and (path.startswith(("/", "\\", "~")) or PureWindowsPath(path).drive):
        return "is an absolute path"
    if not outside and ".." in parts:
        return "leaves the capture's folder with '..'"
    if "\\" in path or not path.isprintable() or not path.strip():
        return "is empty or contains a backslash or a control character"
    if len(path.encode()) > _LONGEST_PATH:
        return f"is longer than {_LONGEST_PATH} bytes"
    return None


def frame_path(pattern: str, frame: int) -> str:
    """The relative path of one frame; a path without placeholder (a video) is returned as it is."""
    return next(frame_paths(pattern, (frame,)))


def frame_paths(pattern: str, frames: Iterable[int]) -> Iterator[str]:
    """`frame_path` of many frames; the pattern is parsed once."""
    match = _PATTERN.fullmatch(pattern)
    if match is None:
        yield from (pattern for _ in frames)
        return
    head, digits, tail = match["head"], int(match["digits"] or 1), match["tail"]
    for frame in frames:
        yield f"{head}{frame:0{digits}d}{tail}"


def frame_numbers(pattern: str) -> Callable[[str], int | None]:
    """A function from a file's name to the number that it has by a pattern; None for files of other names.

    Raises:
        UserError: the number stands in a folder's name, or nowhere.
    """
    match = _PATTERN.fullmatch(pattern)
    if match is None or "/" in match["tail"]:
        problem = f"{pattern!r} has no {{frame}} in the file's own name"
        raise UserError("invalid", problem, "use a path such as cam/rgb/{frame:06d}.png")
    head, digits = match["head"].rpartition("/")[2], int(match["digits"] or 1)
    named = re.compile(rf"{re.escape(head)}([0-9]{{{digits},}}){re.escape(match['tail'])}")

    def number(name: str) -> int | None:
        found = named.fullmatch(name)
        unpadded = found is not None and (len(found[1]) == digits or found[1][0] != "0")
        return int(found[1]) if found is not None and unpadded else None

    return number


def is_inside(folder: Path, path: Path, *, outside: bool = False) -> bool:
    """Whether `path` lies in `folder` after all symbolic links are followed; links in a circle lie nowhere.

    With `outside` it may lie anywhere.
    """
    try:
        return path.resolve().is_relative_to(folder.resolve()) or outside
    except (OSError, RuntimeError):
        return False


def locate(folder: Path, pattern: str, frame: int, *, outside: bool = False) -> Path:
    """The file of one frame, safe to open.

    Args:
        folder, pattern, frame: of the capture.
        outside: whether its files may lie elsewhere.

    Raises:
        UserError: the pattern leaves the folder, or the file is missing or not a regular file.
    """
    relative = frame_path(pattern, frame)
    path = folder / relative
    if path_problem(relative, outside=outside) or not is_inside(folder, path, outside=outside):
        raise UserError("invalid", f"{relative}: leaves the capture's folder {folder}", "put the file inside it")
    if not path.is_file():
        raise UserError("missing", f"{path}: the file is missing", "restore it or validate the capture")
    return path


def safe_name(text: str) -> str:
    """`text` with ASCII letters, digits, dots, hyphens and single underscores only; names joined by `__` stay apart.

    Text of other letters alone becomes their code points: 左 is `u5de6`.
    """
    safe = re.sub(r"_+", "_", re.sub(r"[^A-Za-z0-9.-]", "_", text)).strip("_.")
    return safe or "".join(f"u{ord(letter):x}" for letter in text if letter.isalnum()) or "unnamed"


def distinct_names(texts: Sequence[str]) -> tuple[str, ...]:
    """`safe_name` of each text; where several would share one, all but a text that is safe already get a hash of it.

    A name depends on which texts share it, not on their order.
    """
    names = [safe_name(text) for text in texts]
    taken = {text for text, name in zip(texts, names, strict=True) if text == name}
    return tuple(
        name
        if names.count(name) == 1 or text in taken
        else f"{name}-{number_of(text) % 16**_HASH_DIGITS:0{_HASH_DIGITS}x}"
        for text, name in zip(texts, names, strict=True)
    )
