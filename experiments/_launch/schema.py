"""Every value that an act's configuration takes: key, kind, choices, default and meaning."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from experiments._launch.sources import (
    FieldSource,
    Source,
    definition,
    door_members,
    door_name,
    fields_of,
    first_sentence,
    tree_of,
)

_KINDS = {"int": "INTEGER", "float": "NUMBER", "str": "TEXT", "bool": "true|false", "Path": "PATH"}


_SHARED = {"preset": "sizes that fit together", "seed": "of everything that is drawn at random"}
"""Meanings of fields that mean the same in every act."""
_DEEPEST = 2
"""How often a door may lie behind itself."""


@dataclass(frozen=True)
class Value:
    """One value of a configuration.

    key: dotted. kind: what it takes, such as INTEGER, PATH, hull|constant, [PATH,...].
    default: as it is written on a command line, '' for an empty text; "" where the value must be given.
    about: its meaning. given: whether it names a file or folder that must be there.
    group: name of the group whose members it chooses among; "" for a plain value.
    """

    key: str
    kind: str
    default: str
    about: str
    given: bool = False
    group: str = ""


@dataclass(frozen=True)
class Schema:
    """The values of an act, and the sections that they stand in.

    values: in the order of the dataclass; those of a door are the default member's.
    sections: meaning of each nested dataclass by its dotted key.
    others: dotted keys that only other members of doors take.
    """

    values: tuple[Value, ...]
    sections: dict[str, str] = field(default_factory=dict)
    others: frozenset[str] = frozenset()

    def keys(self) -> set[str]:
        """Everything before an equals sign that means something."""
        groups = {value.group for value in self.values if value.group}
        return {value.key for value in self.values} | set(self.sections) | set(self.others) | groups


def schema_of(module: str, chosen: dict[str, str] | None = None) -> Schema | None:
    """The values that `python -m <module>` takes; None where the module is no act with a configuration.

    Args:
        module: such as `experiments.classify`.
        chosen: members by group that the command line names.
    """
    config = _config_of(module)
    if config is None:
        return None
    sections: dict[str, str] = {}
    others: set[str] = set()
    values = tuple(_values(config, "", chosen or {}, sections, others))
    return Schema(values, sections, frozenset(others) - {value.key for value in values})


def _config_of(module: str) -> Source | None:
    for node in tree_of(module).body:
        if isinstance(node, ast.FunctionDef) and node.name == "main":
            for call in node.decorator_list:
                if isinstance(call, ast.Call) and ast.unparse(call.func) == "experiment" and call.args:
                    return definition(module, ast.unparse(call.args[0]))
    return None


def _values(
    config: Source,
    prefix: str,
    chosen: dict[str, str],
    sections: dict[str, str],
    others: set[str],
    doors: tuple[Source, ...] = (),
) -> Iterator[Value]:
    """Values below a key. `doors` are those that it lies behind: an ensemble's members may be ensembles in turn."""
    for one in fields_of(config):
        key = prefix + one.name
        kind = _without_none(one.annotation)
        inner = one.owner.lookup(kind.id) if isinstance(kind, ast.Name) else None
        if inner is None or not isinstance(inner.node, ast.ClassDef):
            if one.name == "name" and _kind(kind, one.owner) == _default(one):
                others.add(key)  # a member's own name: there is nothing to choose
                continue
            yield Value(
                key, _kind(kind, one.owner), _default(one), one.about or _SHARED.get(one.name, ""), given=_is_given(one)
            )
            continue
        members = door_members(inner)
        if not members:
            sections[key] = one.about or first_sentence(inner)
            yield from _values(inner, f"{key}.", chosen, sections, others, doors)
            continue
        group = door_name(inner)
        standard = next((name for name, source in members.items() if source == _made_by(one)), "null")
        yield Value(key, "|".join(members), standard, one.about or first_sentence(inner), group=group)
        for name, source in members.items() if doors.count(inner) < _DEEPEST else ():
            inside = _values(source, f"{key}.", chosen, {}, others, (*doors, inner))
            found = list(inside)
            others |= {value.key for value in found}
            if name == chosen.get(group, standard):
                yield from found


def _without_none(annotation: ast.expr) -> ast.expr:
    """`X` of `X | None`."""
    if isinstance(annotation, ast.BinOp) and ast.unparse(annotation.right) == "None":
        return annotation.left
    return annotation


def _kind(annotation: ast.expr, owner: Source) -> str:
    annotation = _without_none(annotation)
    if isinstance(annotation, ast.Subscript):
        head, inside = ast.unparse(annotation.value), annotation.slice
        parts = inside.elts if isinstance(inside, ast.Tuple) else [inside]
        if head == "Literal":
            return "|".join(str(ast.literal_eval(part)) for part in parts)
        if head == "tuple":
            last = isinstance(parts[-1], ast.Constant) and parts[-1].value is ...
            return (
                "[" + ",".join([*(_kind(part, owner) for part in parts[: -1 if last else None]), *["..."] * last]) + "]"
            )
        return {"Mapping": "{KEY: VALUE}", "dict": "{KEY: VALUE}"}.get(head, ast.unparse(annotation))
    if isinstance(annotation, ast.BinOp):
        return f"{_kind(annotation.left, owner)}|{_kind(annotation.right, owner)}"
    name = ast.unparse(annotation)
    found = owner.lookup(name) if name not in _KINDS else None
    if found is not None and isinstance(found.node, ast.Assign):
        return _kind(found.node.value, Source(found.module, found.node))
    return _KINDS.get(name, name)


def _default(one: FieldSource) -> str:
    node = one.default
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "field":
        keywords = {keyword.arg: keyword.value for keyword in node.keywords}
        node = keywords.get("default", keywords.get("default_factory"))
    if isinstance(node, ast.Name):
        found = one.owner.lookup(node.id)
        node = getattr(found.node, "value", node) if found is not None else node
    return "" if node is None else _written(node)


def _written(node: ast.expr) -> str:
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "Path":
        return str(Path(*map(ast.literal_eval, node.args)))
    try:
        value = ast.literal_eval(node)
    except ValueError:
        return ast.unparse(node)
    return _plain(value)


def _plain(value: object) -> str:
    if isinstance(value, tuple | list):
        return "[" + ",".join(map(_plain, value)) + "]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return str(value) or "''"


def _is_given(one: FieldSource) -> bool:
    return one.default is not None and "'given': True" in ast.unparse(one.default)


def _made_by(one: FieldSource) -> Source | None:
    """The class that the default of a door's field makes."""
    if isinstance(one.default, ast.Call):
        for keyword in one.default.keywords:
            if keyword.arg == "default_factory" and isinstance(keyword.value, ast.Name):
                return one.owner.lookup(keyword.value.id)
    return None
