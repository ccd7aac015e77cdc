"""Strict mapping -> frozen dataclass: an unknown, missing or mistyped key is an error that names it.

Where a list is expected, one value stands for a list of one. A field whose type is the base class of a door (it has
`members: ClassVar[str]`, the module whose `MEMBERS` lists the members by name) holds one of the members: its mapping's
`name` says which, or the field's default if there is no name.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar, cast, get_args, get_origin, get_type_hints

import cattrs
import cattrs.gen
from cattrs.cols import homogenous_tuple_structure_factory
from cattrs.errors import ForbiddenExtraKeysError

from aerojax.core.errors import UserError

_T = TypeVar("_T")


def _strict(kind: type, accepted: tuple[type, ...]) -> Any:
    def structure(value: Any, _: Any) -> Any:
        if (isinstance(value, bool) and kind is not bool) or not isinstance(value, accepted):
            raise TypeError(f"expected {kind.__name__}, got {value!r}")
        return kind(value)

    return structure


def _choice(value: Any, kind: Any) -> Any:
    if not any(value == option and type(value) is type(option) for option in get_args(kind)):
        raise ValueError(f"expected one of {', '.join(map(repr, get_args(kind)))}; got {value!r}")
    return value


def _is_list(kind: Any) -> bool:
    return get_origin(kind) is tuple and get_args(kind)[-1:] == (...,)


def _list_of(converter: cattrs.Converter, kind: Any) -> Any:
    """How a tuple of any length is made: text is one value and no list of letters."""
    made = homogenous_tuple_structure_factory(kind, converter)

    def structure(value: Any, of: Any) -> Any:
        if value is None or isinstance(value, Mapping):
            raise TypeError(f"expected a list, got {value!r}")
        return made(value if isinstance(value, list | tuple) else [value], of)

    return structure


def _describe(error: BaseException, expected: Any) -> str:
    if isinstance(error, ForbiddenExtraKeysError):
        return f"unknown key(s) {', '.join(sorted(map(str, error.extra_fields)))}"
    if isinstance(error, KeyError):
        return "required key is missing"
    return str(error) or f"expected {expected}"


def _converter() -> cattrs.Converter:
    converter = cattrs.Converter(forbid_extra_keys=True, detailed_validation=True)
    for kind, accepted in ((int, (int,)), (float, (int, float)), (str, (str,)), (bool, (bool,))):
        converter.register_structure_hook(kind, _strict(kind, accepted))
    path = _strict(Path, (str, Path))
    converter.register_structure_hook(Path, lambda value, kind: path(value, kind).expanduser())  # a shell's ~ in quotes
    converter.register_structure_hook_func(lambda kind: get_origin(kind) is Literal, _choice)
    converter.register_structure_hook_factory(_is_list, lambda kind: _list_of(converter, kind))
    converter.register_structure_hook_factory(_has_door, lambda kind: _with_default_members(converter, kind))
    converter.register_structure_hook_func(is_door, lambda value, door: _member(converter, value, door))
    converter.register_unstructure_hook_func(is_door, lambda config: converter.unstructure(config, type(config)))
    return converter


def is_door(kind: Any) -> bool:
    """Whether a type is the base class of a door's members; the members themselves are ordinary dataclasses."""
    return isinstance(kind, type) and "members" in vars(kind)


def members_of(door: type) -> Mapping[str, type]:
    """The configuration classes of a door's members, by name."""
    return importlib.import_module(door.members).MEMBERS  # type: ignore[attr-defined]  # pyrefly: ignore


def default_of(field: dataclasses.Field[Any]) -> Any:
    """A field's default value; `dataclasses.MISSING` if it has none."""
    made = field.default_factory is not dataclasses.MISSING
    return field.default_factory() if made else field.default  # type: ignore[misc]  # pyrefly: ignore


def _member(converter: cattrs.Converter, value: Any, door: Any) -> Any:
    """The member of a door that a mapping names."""
    members = members_of(door)
    name = value.get("name") if isinstance(value, Mapping) else None
    if name not in members:
        raise ValueError(f"name is {name!r}; choose one of {', '.join(sorted(members))}")
    return converter.structure(value, members[name])


def door_of(kind: Any) -> type | None:
    """The door that a field of this type, or of this type or None, holds a member of; None if it is no such field."""
    return next((option for option in (kind, *get_args(kind)) if is_door(option)), None)


def _has_door(kind: Any) -> bool:
    return dataclasses.is_dataclass(kind) and any(map(door_of, get_type_hints(kind).values()))


def _with_default_members(converter: cattrs.Converter, kind: Any) -> Callable[[Any, Any], Any]:
    """How a dataclass that holds members is made: a mapping without a name belongs to the field's default member."""
    made = cattrs.gen.make_dict_structure_fn(kind, converter, _cattrs_forbid_extra_keys=True)
    hints, names = get_type_hints(kind), {}
    for field in dataclasses.fields(kind):
        default = default_of(field)
        if door_of(hints[field.name]) and default not in (None, dataclasses.MISSING):
            names[field.name] = default.name

    def structure(value: Any, of: Any) -> Any:
        if isinstance(value, Mapping):
            unnamed = [key for key in names if isinstance(value.get(key), Mapping) and "name" not in value[key]]
            value = {**value, **{key: {"name": names[key], **value[key]} for key in unnamed}}
        return made(value, of)

    return structure


def part_of(config: Any, kind: type[_T]) -> _T:
    """The fields of `kind`, a dataclass that the configuration extends, without what was added to them."""
    assert isinstance(config, kind)
    return kind(**{item.name: getattr(config, item.name) for item in dataclasses.fields(cast(Any, kind))})


def require_at_least(config: Any, *names: str, least: int | float = 1) -> None:
    """Refuse fields of a configuration that are too small, or no numbers; for its `__post_init__`.

    Raises:
        UserError: names the first such field, its value and the least that works.
    """
    for name in names:
        if not getattr(config, name) >= least:
            problem = f"{name} is {getattr(config, name)} in {type(config).__name__}"
            raise UserError("out-of-range", problem, f"it must be at least {least:g}")


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
        problems = [_tidy(line) for line in lines]
        told = f" {problems[0]}" if len(problems) == 1 else "".join(f"\n  {problem}" for problem in problems)
        raise UserError("mismatch", f"{source} does not fit {config_type.__name__}:{told}") from None


def _tidy(line: str) -> str:
    message, _, path = line.partition(" @ ")
    path = path.lstrip(".")
    return f"{path}: {message}" if path else message


def to_mapping(config: Any) -> dict[str, Any]:
    """A config dataclass as plain, JSON-ready containers."""
    return to_plain(config)


def to_plain(value: Any) -> Any:
    """A config dataclass, or the value of a field of one, as plain, JSON-ready containers and scalars."""
    return _CONVERTER.unstructure(value)


__all__ = [
    "default_of",
    "door_of",
    "is_door",
    "members_of",
    "require_at_least",
    "to_dataclass",
    "to_mapping",
    "to_plain",
]
