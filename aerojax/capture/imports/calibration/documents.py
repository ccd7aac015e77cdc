"""JSON and YAML files of calibrations, and numbers in them; every complaint names the file and the field."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from jaxtyping import Float64

from aerojax.core.errors import UserError

LARGEST = 256 * 2**20
"""Bytes; a nerfstudio file of a hundred thousand images stays below it."""
SUFFIXES = (".json", ".yaml", ".yml")
ROTATION_TOLERANCE = 1e-3
"""Largest entry of R Rᵀ - I; four decimals are up to 2e-4 off."""


_MOST_NUMBERS = 3_000_000
"""Of one list; a YAML file of a kilobyte can name lists within lists that hold more than any memory."""


class _Loader(yaml.SafeLoader):
    """Plain YAML and OpenCV's matrices; nothing else makes an object."""


def _opencv_matrix(loader: yaml.SafeLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    return loader.construct_mapping(node, deep=True)


_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _opencv_matrix)


def read_document(path: Path) -> Any:
    """Content of a JSON or YAML file, OpenCV's `FileStorage` among them; matrices stay mappings.

    Raises:
        UserError: the file is missing, too large or neither of these.
    """
    text = read_text(path)
    try:
        if path.suffix.lower() == ".json":
            return json.loads(text)
        if text.startswith("%YAML"):
            text = text.split("\n", 1)[1]  # `%YAML:1.0`, as OpenCV 4 writes it, is no directive of YAML
        return yaml.load(text, _Loader)
    except (ValueError, IndexError, RecursionError, yaml.YAMLError) as error:
        kind = "JSON" if path.suffix.lower() == ".json" else "YAML"
        raise UserError(
            "unreadable", f"{path}: is not valid {kind}: {str(error)[:160]}", "repair the file or write it again"
        ) from None


def read_text(path: Path) -> str:
    """Text of a calibration file.

    Raises:
        UserError: the file is missing, too large or no text.
    """
    try:
        if path.stat().st_size > LARGEST:
            raise UserError("invalid", f"{path}: is larger than {LARGEST >> 20} MiB", "is this a calibration?")
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise UserError("unreadable", f"{path}: is no text", "give the calibration's file or folder") from None
    except (OSError, ValueError) as error:  # also a name that no file can have
        raise UserError("missing", f"{path}: cannot be read: {error}", "correct the path") from None


def brief(value: Any) -> str:
    """A value of the user's file for a message, in time that does not depend on how much its anchors unfold to."""
    return ascii(reprlib.repr(value))[1:-1][:60]


def mapping(value: Any, where: str) -> Mapping[str, Any]:
    """A mapping.

    Raises:
        UserError: it is none.
    """
    if not isinstance(value, Mapping):
        raise UserError("invalid", f"{where} must be a mapping, is {brief(value)}", "is this the right format?")
    return value


def first_of(document: Mapping[str, Any], keys: Sequence[str]) -> tuple[str, Any] | None:
    """The first of several keys that is there, with its value."""
    return next(((key, document[key]) for key in keys if document.get(key) is not None), None)


def needed(document: Mapping[str, Any], keys: Sequence[str], where: str) -> tuple[str, Any]:
    """`first_of`, where one must be there.

    Raises:
        UserError: none is.
    """
    found = first_of(document, keys)
    if found is None:
        raise UserError("missing", f"{where}: has no {' or '.join(keys)}", "add it, or choose another format")
    return found


def number(value: Any, where: str) -> float:
    """A finite number; text that is one counts, because YAML takes `1e-05` for text.

    Raises:
        UserError: it is none.
    """
    return float(numbers([value], where, 1)[0])


def whole(value: Any, where: str) -> int:
    """A positive whole number.

    Raises:
        UserError: it is none.
    """
    found = number(value, where)
    if found != int(found) or found < 1:
        raise UserError("invalid", f"{where} must be a positive whole number, is {brief(value)}", "correct it")
    return int(found)


def numbers(value: Any, where: str, *counts: int) -> Float64[np.ndarray, "number"]:
    """Finite numbers of a list, nested or not, or of a matrix that OpenCV or ROS wrote.

    Args:
        value: of the document.
        where: file and field, for the message.
        counts: how many there may be; any number where none is given.

    Raises:
        UserError: they are not numbers, or not so many.
    """
    if isinstance(value, Mapping):
        value = value.get("data")
    try:
        found = np.array(_leaves(value), dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise UserError("invalid", f"{where} must be numbers, is {brief(value)}", "correct it") from None
    if not np.all(np.isfinite(found)) or (counts and len(found) not in counts):
        wanted = " or ".join(map(str, counts)) or "any number of"
        raise UserError("invalid", f"{where} must be {wanted} finite numbers, has {len(found)}", "correct it")
    return found


def _leaves(value: Any) -> list[Any]:
    """What stands in nested lists, at most `_MOST_NUMBERS`; truth values are no numbers."""
    found: list[Any] = []
    levels = [iter((value,))]
    while levels:
        for one in levels[-1]:
            if isinstance(one, list | tuple | np.ndarray):
                levels.append(iter(one))
                break
            if isinstance(one, bool) or len(found) == _MOST_NUMBERS:
                raise ValueError
            found.append(one)
        else:
            levels.pop()
    return found


def rigid(matrix: Float64[np.ndarray, "3 4"] | Float64[np.ndarray, "4 4"], where: str) -> Float64[np.ndarray, "4 4"]:
    """A rigid transform whose rotation is made orthonormal if its digits were rounded.

    Raises:
        UserError: it scales, shears or mirrors.
    """
    rotation = matrix[:3, :3]
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if not off <= ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        kind = "mirrors" if off <= ROTATION_TOLERANCE else f"scales or shears (off by {off:.2g})"
        raise UserError("invalid", f"{where}: the rotation {kind}", "write a rotation and a translation")
    left, _, right = np.linalg.svd(rotation)
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = left @ right, matrix[:3, 3]
    return result


def files_in(source: Path, suffixes: Sequence[str] = SUFFIXES) -> list[Path]:
    """The file `source`, or the files in that folder with one of the suffixes, sorted by name.

    Raises:
        UserError: there is none.
    """
    if source.is_file():
        return [source]
    found = sorted(p for p in source.glob("*") if p.suffix.lower() in suffixes) if source.is_dir() else []
    if not found:
        endings = ", ".join(suffixes)
        raise UserError("missing", f"source={source}: no file, or a folder without {endings}", "correct the path")
    return found
