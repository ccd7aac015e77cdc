"""Whose place a folder is: the configuration that its contents were made with, noted in one JSON file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aerojax.core.errors import UserError
from aerojax.core.files import write_json


def claim(path: Path, values: Mapping[str, Any], *, ignoring: tuple[str, ...] = ()) -> None:
    """Note a configuration in `path`, or find it to be the one that is noted there.

    Args:
        path: the record; what lies in its folder was, or will be, made with this configuration.
        values: plain containers; compared as JSON has them.
        ignoring: first-level keys that say how something is computed and not what.

    Raises:
        UserError: another configuration is noted; names the keys that differ.
    """
    noted = claimed(path)
    if noted is None:
        write_json(path, plain(values))
    else:
        check_claim(path, noted, values, ignoring=ignoring)


def check_claim(
    path: Path, noted: Mapping[str, Any], values: Mapping[str, Any], *, ignoring: tuple[str, ...] = ()
) -> None:
    """Find a configuration to be the one that a record holds; for records that hold more than it.

    Args:
        path: the record.
        noted: the configuration in it.
        values, ignoring: as for `claim`.

    Raises:
        UserError: they differ; names the keys.
    """
    if changed := differing(noted, values, ignoring=ignoring):
        raise UserError(
            "occupied",
            f"{path}: the folder holds what was made with another {', '.join(changed)}",
            "choose another folder",
        )


def claimed(path: Path) -> dict[str, Any] | None:
    """The configuration that is noted in `path`, None where there is no record.

    Raises:
        UserError: the record is damaged.
    """
    if not path.is_file():
        return None
    try:
        noted = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        noted = None
    if not isinstance(noted, dict):
        raise UserError("unreadable", f"{path}: is not a JSON object", "delete it, and what lies beside it")
    return noted


def differing(noted: Mapping[str, Any], values: Mapping[str, Any], *, ignoring: tuple[str, ...] = ()) -> list[str]:
    """First-level keys whose values differ, or that only one of the two has, sorted."""
    present = plain(values)
    keys = {*noted, *present} - set(ignoring)
    return sorted(key for key in keys if key not in noted or key not in present or noted[key] != present[key])


def plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values as JSON gives them back: tuples are lists, paths are text."""
    return json.loads(json.dumps(values, default=str))
