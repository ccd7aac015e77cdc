"""Families of assets: ranges of parameters, read from TOML files, and individuals drawn from them.

Beside the code of a class lie `families_shared.toml`, ranges that families build on, and `families_<split>.toml`, the
families of each split in the order in which identities take them. The class's dataclasses of parameters are the schema
of a table's entries:

    [gull]
    extends = "common"                      # every entry of that shared table that is not given here
    aspect = [8.0, 10.0]                    # uniform between two numbers, both included if they are integers
    tail = { one_of = ["fan", "square"] }   # equally likely; a value given twice is twice as likely
    bounding = false                        # the same for all
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from aerojax.core.errors import UserError
from aerojax.data.splits import SPLITS, Split

_T = TypeVar("_T")

Value = bool | int | float | str
Range = Value | tuple[int, int] | tuple[float, float] | list[Value]
"""A fixed value, a uniform range or a choice of equals."""


@dataclasses.dataclass(frozen=True)
class Family:
    """One kind of object.

    split: the part of a data set that all of its individuals belong to.
    ranges: by field of the class's parameters; a field with a default may be absent.
    """

    name: str
    split: Split
    ranges: Mapping[str, Range]


def read_families(folder: Path, kinds: tuple[type, ...], derived: Collection[str] = ()) -> dict[str, Family]:
    """Read every family of a class strictly.

    Args:
        folder: of `families_shared.toml` and one `families_<split>.toml` a split.
        kinds: dataclasses whose fields the families give ranges for; no two share a field.
        derived: fields that are computed from others and that no file may name.

    Returns:
        Families by name: those of "train", "val" and "test", each in the order of their file.

    Raises:
        UserError: if a file is missing or is not TOML; names file, family and field of everything that does not fit
            the dataclasses, all at once.
    """
    schema = _Schema(kinds, derived)
    shared, problems = _read_tables(folder / "families_shared.toml", schema, {})
    found: dict[str, Family] = {}
    for split in SPLITS:
        path = folder / f"families_{split}.toml"
        tables, wrong = _read_tables(path, schema, shared)
        problems += wrong
        for name, ranges in tables.items():
            if name in found:
                problems.append(f"{path.name}: {name} is a family of {found[name].split} already")
            problems += [f"{path.name}: {name}.{field} is missing" for field in schema.needed if field not in ranges]
            found[name] = Family(name, split, ranges)
    if problems:
        raise UserError("invalid", f"families in {folder} do not fit:\n  " + "\n  ".join(problems))
    return found


class _Schema:
    """Types of all fields, and those that have no default."""

    def __init__(self, kinds: tuple[type, ...], derived: Collection[str]):
        fields = {f.name: f for kind in kinds for f in dataclasses.fields(kind) if f.name not in derived}
        hints = {name: hint for kind in kinds for name, hint in get_type_hints(kind).items()}
        self.types: dict[str, Any] = {name: hints[name] for name in fields}
        self.needed = tuple(name for name, field in fields.items() if field.default is dataclasses.MISSING)

    def read(self, field: str, raw: Any) -> Range:
        """An entry of a table as `draw` takes it.

        Raises:
            ValueError: if the field is unknown or the entry is not of its type.
        """
        if field not in self.types:
            raise ValueError(f"{field} is no parameter; use {', '.join(self.types)}")
        kind = self.types[field]
        if isinstance(raw, list):
            if kind in (int, float) and len(raw) == 2 and all(_fits(v, kind) for v in raw) and raw[0] <= raw[1]:
                return raw[0], raw[1]
            raise ValueError(f"{field} is {raw!r}; a range is [low, high] of {_called(kind)}")
        if isinstance(raw, dict):
            values = raw.get("one_of")
            if len(raw) == 1 and isinstance(values, list) and values and all(_fits(v, kind) for v in values):
                return values
            raise ValueError(f"{field} is {raw!r}; a choice is {{ one_of = [...] }} of {_called(kind)}")
        if not _fits(raw, kind):
            raise ValueError(f"{field} is {raw!r}; expected {_called(kind)}")
        return raw


def _fits(value: object, kind: Any) -> bool:
    """Whether a value has a field's type: a float is written with its point, and a word is one of the field's."""
    if get_origin(kind) is Literal:
        return value in get_args(kind)
    return type(value) is kind and (not isinstance(value, float) or math.isfinite(value))


def _called(kind: Any) -> str:
    return " or ".join(map(repr, get_args(kind))) if get_origin(kind) is Literal else kind.__name__


def _read_tables(
    path: Path, schema: _Schema, shared: Mapping[str, dict[str, Range]]
) -> tuple[dict[str, dict[str, Range]], list[str]]:
    """A file's tables with what they inherit, from `shared` or from tables before them; and what is wrong with them."""
    tables: dict[str, dict[str, Range]] = {}
    problems: list[str] = []
    for name, entries in _read_toml(path).items():
        if not isinstance(entries, dict):
            problems.append(f"{path.name}: {name} is no table; write [{name}] and its fields below")
            continue
        base, known = entries.pop("extends", None), shared or tables
        if base is not None and base not in known:
            problems.append(f"{path.name}: {name}.extends is {base!r}; use one of {', '.join(known)}")
        tables[name] = dict(known.get(base, {}))
        for field, raw in entries.items():
            try:
                tables[name][field] = schema.read(field, raw)
            except ValueError as error:
                problems.append(f"{path.name}: {name}.{error}")
                tables[name][field] = 0  # so that it is not called missing too
    return tables, problems


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError("missing", f"{path} does not exist", "install the package with its data files") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserError("unreadable", f"{path} is not readable TOML: {error}", "correct that line") from error


def names_by_split(families: Mapping[str, Family]) -> dict[Split, tuple[str, ...]]:
    """Names of each split's families, in the order in which identities take them."""
    return {split: tuple(f.name for f in families.values() if f.split == split) for split in SPLITS}


def draw(kind: type[_T], ranges: Mapping[str, Range], rng: np.random.Generator) -> _T:
    """Fill a dataclass of parameters from a family's ranges.

    Fields are drawn in the order of the class, so that a seed means the same whatever the order of `ranges`, which may
    hold fields of other classes too.
    """
    fields = [f.name for f in dataclasses.fields(kind) if f.name in ranges]  # pyrefly: ignore
    return kind(**{name: _draw_one(ranges[name], rng) for name in fields})


def _draw_one(given: Range, rng: np.random.Generator) -> Value:
    if isinstance(given, list):
        return given[int(rng.integers(len(given)))]
    if not isinstance(given, tuple):
        return given
    low, high = given
    if isinstance(low, int) and isinstance(high, int):
        return int(rng.integers(low, high + 1))
    return float(rng.uniform(low, high))
