"""Dataclasses read from their sources, so that help and mistakes do not wait until JAX is loaded.

Only what configurations are made of is understood: annotated fields, their defaults, bases, `Literal`s, and names that
other modules give with `from … import`.
"""

from __future__ import annotations

import ast
import importlib.util
import inspect
import itertools
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path


@dataclass(frozen=True)
class Source:
    """A definition, and the module where its names mean something."""

    module: str
    node: ast.stmt

    def lookup(self, name: str) -> Source | None:
        """What a name in this definition stands for."""
        return definition(self.module, name)


@dataclass(frozen=True)
class FieldSource:
    """A field of a dataclass.

    owner: the class that declares it. about: what its docstring says of the field; "" if nothing.
    """

    name: str
    annotation: ast.expr
    default: ast.expr | None
    owner: Source
    about: str


@cache
def tree_of(module: str) -> ast.Module:
    """The syntax of a module of ours.

    Raises:
        FileNotFoundError: there is no such module.
    """
    top, *rest = module.split(".")
    spec = importlib.util.find_spec(top)
    places = [] if spec is None else spec.submodule_search_locations or []
    for place in places:
        path = Path(place).joinpath(*rest)
        for file in (path.with_suffix(".py") if rest else path / "__init__.py", path / "__init__.py"):
            if file.is_file():
                return ast.parse(file.read_text(encoding="utf-8"))
    raise FileNotFoundError(module)


@cache
def definition(module: str, name: str) -> Source | None:
    """The class or value that a module gives a name, followed through imports; None where it is not one of ours."""
    try:
        body = tree_of(module).body
    except FileNotFoundError:
        return None
    for node in body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                if (alias.asname or alias.name) == name and _is_ours(node.module or ""):
                    return definition(node.module or "", alias.name)
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        named = isinstance(node, ast.ClassDef) and node.name == name
        if named or any(isinstance(target, ast.Name) and target.id == name for target in targets):
            return Source(module, node)
    return None


def _is_ours(module: str) -> bool:
    return module.split(".")[0] in ("aerojax", "experiments", "kernels")


def fields_of(config: Source) -> list[FieldSource]:
    """The fields of a dataclass with those of its bases first, each with the words of the class that says most."""
    assert isinstance(config.node, ast.ClassDef)
    found: dict[str, FieldSource] = {}
    for base in config.node.bases:
        source = config.lookup(base.id) if isinstance(base, ast.Name) else None
        if source is not None and isinstance(source.node, ast.ClassDef):
            found |= {field.name: field for field in fields_of(source)}
    declared = {
        node.target.id: node
        for node in config.node.body
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and not _is_class_variable(node)
    }
    words = field_words(ast.get_docstring(config.node) or "", [*found, *declared]) | _words_below(config.node)
    for name, node in declared.items():
        about = words.get(name) or (found[name].about if name in found else "")
        found[name] = FieldSource(name, node.annotation, node.value, config, about)
    for name in words.keys() & found.keys() - declared.keys():
        old = found[name]
        found[name] = FieldSource(name, old.annotation, old.default, old.owner, words[name])
    return list(found.values())


def _is_class_variable(node: ast.AnnAssign) -> bool:
    return "ClassVar" in ast.unparse(node.annotation)


def _words_below(config: ast.ClassDef) -> dict[str, str]:
    """What strings say that follow the fields they describe."""
    found = {}
    for node, after in itertools.pairwise(config.body):
        if isinstance(node, ast.AnnAssign) and isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            found[ast.unparse(node.target)] = " ".join(str(after.value.value).split())
    return found


def first_sentence(source: Source) -> str:
    """What a class is for."""
    assert isinstance(source.node, ast.ClassDef)
    return " ".join((ast.get_docstring(source.node) or "").split("\n\n")[0].split())


def field_words(docstring: str, names: list[str]) -> dict[str, str]:
    """What a docstring says of each field: `name: words` or `one, other: words`, at a line's start or after a stop."""
    text, found = inspect.cleandoc(docstring), {}
    entry = re.compile(r"(?:^|(?<=[.;] ))(\w+(?:, \w+)*): ", re.MULTILINE)
    entries = [match for match in entry.finditer(text) if all(name in names for name in match[1].split(", "))]
    ends = [match.start() for match in entries[1:]] + [len(text)]
    for match, end in zip(entries, ends, strict=False):  # without an entry there is an end too many
        words = text[match.end() : end].split("\n\n")[0]
        for name in match[1].split(", "):
            found[name] = " ".join(words.split())
    return found


def door_members(config: Source) -> dict[str, Source]:
    """The classes behind a door by name; empty for a class that is none."""
    assert isinstance(config.node, ast.ClassDef)
    for node in config.node.body:
        if not (isinstance(node, ast.AnnAssign) and isinstance(node.value, ast.Constant)):
            continue
        if isinstance(node.target, ast.Name) and node.target.id == "members":
            table = definition(str(node.value.value), "MEMBERS")
            value = None if table is None else getattr(table.node, "value", None)
            if table is not None and isinstance(value, ast.Dict):
                pairs = zip(value.keys, value.values, strict=True)
                members = {
                    k.value: table.lookup(v.id)
                    for k, v in pairs
                    if isinstance(k, ast.Constant) and isinstance(v, ast.Name)
                }
                return {str(name): source for name, source in members.items() if source is not None}
    return {}


def door_name(config: Source) -> str:
    """Name of the group that chooses among a door's members: the folder of the module that lists them."""
    assert isinstance(config.node, ast.ClassDef)
    values = [n.value for n in config.node.body if isinstance(n, ast.AnnAssign) and ast.unparse(n.target) == "members"]
    return str(values[0].value).split(".")[-2] if values and isinstance(values[0], ast.Constant) else ""
