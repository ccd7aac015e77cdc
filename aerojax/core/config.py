"""Strict mapping -> frozen dataclass: an unknown, missing or mistyped key is an error that names it.

A field whose type is the base class of a door (it has `members: ClassVar[str]`, the module whose `MEMBERS` lists the
members by name) holds one of the members: its mapping's `name` says which.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import cattrs
from cattrs.errors import ForbiddenExtraKeysError

from aerojax.core.errors import UserError

_T = TypeVar("_T")


def _strict(kind: type, accepted: tuple[type, ...]) -> Any:
    def structure(value: Any, _: Any) -> Any:
        if (isinstance(value, bool) and kind is not bool) or not isinstance(value, accepted):
            raise TypeError(f"expected {kind.__name__}, got {value!r}")
        return kind(value)

    return structure


def _describe(error: BaseException, expected: Any) -> str:
    if isinstance(error, ForbiddenExtraKeysError):
        return f"unknown key(s) {', '.join(sorted(error.extra_fields))}"
    if isinstance(error, KeyError):
        return "required key is missing"
    return str(error) or f"expected {expected}"


def _converter() -> cattrs.Converter:
    converter = cattrs.Converter(forbid_extra_keys=True, detailed_validation=True)
    for kind, accepted in ((int, (int,)), (float, (int, float)), (str, (str,)), (bool, (bool,)), (Path, (str, Path))):
        converter.register_structure_hook(kind, _strict(kind, accepted))
    # Only the base class itself is a door, its members are ordinary dataclasses.
    converter.register_structure_hook_func(_is_door, lambda value, door: _member(converter, value, door))
    converter.register_unstructure_hook_func(_is_door, lambda config: converter.unstructure(config, type(config)))
    return converter


def _is_door(kind: Any) -> bool:
    return isinstance(kind, type) and "members" in vars(kind)


def _member(converter: cattrs.Converter, value: Any, door: Any) -> Any:
    """The member of a door that a mapping names."""
    members: Mapping[str, type] = importlib.import_module(door.members).MEMBERS
    name = value.get("name") if isinstance(value, Mapping) else None
    if name not in members:
        raise ValueError(f"name is {name!r}; choose one of {', '.join(sorted(members))}")
    return converter.structure(value, members[name])


_CONVERTER = _converter()


def to_dataclass(values: Mapping[str, Any], config_type: type[_T], *, source: str = "config") -> _T:
    """Turn a nested mapping into `config_type`, refusing whatever does not fit.

    Args:
        values: plain containers (no OmegaConf objects).
        config_type: a frozen dataclass; nested dataclasses, tuples, optionals and `Literal`s are followed.
        source: where the values come from, for the message.

    Raises:
        UserError: names every key that is unknown, missing or of the wrong type, all at once.
    """
    try:
        return _CONVERTER.structure(dict(values), config_type)
    except cattrs.BaseValidationError as error:
        lines = cattrs.transform_error(error, path="", format_exception=_describe)
        problems = "\n".join("  " + _tidy(line) for line in lines)
        raise UserError("mismatch", f"{source} does not fit {config_type.__name__}:\n{problems}") from None


def _tidy(line: str) -> str:
    message, _, path = line.partition(" @ ")
    path = path.lstrip(".")
    return f"{path}: {message}" if path else message


def to_mapping(config: Any) -> dict[str, Any]:
    """A config dataclass as plain, JSON-ready containers."""
    return _CONVERTER.unstructure(config)


__all__ = ["to_dataclass", "to_mapping"]
