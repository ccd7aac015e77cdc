"""States of the stages as numbers and JSON: no code is stored, and none is run when they are read.

A state is a tree of plain values, arrays, containers and frozen dataclasses of this package. Of a dataclass the name is
stored; reading makes it anew from its fields, and refuses classes from anywhere else.
"""

from __future__ import annotations

import dataclasses
import importlib
import math
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

_PACKAGE = __name__.rpartition(".")[0].rpartition(".")[0]
"""Whose classes may be stored: `aerojax`."""


class NotStorable(ValueError):
    """A value that is neither plain nor made of what can be stored; the message names its type."""


def to_tree(value: Any) -> tuple[Any, dict[str, np.ndarray]]:
    """JSON-ready structure, and the arrays that it refers to by name.

    Raises:
        NotStorable: something in it cannot be stored.
    """
    arrays: dict[str, np.ndarray] = {}
    return _encoded(value, arrays), arrays


def _encoded(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    if value is None or isinstance(value, bool | str) or type(value) is int:
        return value
    if type(value) is float:
        return value if math.isfinite(value) else {"float": repr(value)}
    if isinstance(value, jax.Array | np.ndarray | np.generic):
        if not (isinstance(value.dtype, np.dtype) and value.dtype.kind in "biuf"):
            raise NotStorable(f"an array of {value.dtype}")
        name = f"a{len(arrays)}"
        arrays[name] = np.asarray(value).reshape(-1)
        kind = "jax" if isinstance(value, jax.Array) else "numpy" if isinstance(value, np.ndarray) else "scalar"
        return {kind: name, "shape": list(value.shape)}
    if type(value) in (tuple, list, frozenset):
        items = sorted(value) if isinstance(value, frozenset) else value
        return {type(value).__name__: [_encoded(one, arrays) for one in items]}
    if isinstance(value, Mapping):
        return {"dict": [[_encoded(key, arrays), _encoded(one, arrays)] for key, one in value.items()]}
    kind = type(value)
    if dataclasses.is_dataclass(kind) and kind.__module__.split(".")[0] == _PACKAGE:
        fields = {one.name: _encoded(getattr(value, one.name), arrays) for one in dataclasses.fields(kind)}
        return {"class": f"{kind.__module__}:{kind.__qualname__}", "fields": fields}
    raise NotStorable(f"{kind.__module__}.{kind.__qualname__}")


def from_tree(node: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """Inverse of `to_tree`.

    Raises:
        ValueError, KeyError, TypeError, AttributeError, ImportError: the structure is none that `to_tree` makes.
    """
    if not isinstance(node, dict):
        return node
    if "class" in node:
        return _made(_class(node["class"]), {name: from_tree(one, arrays) for name, one in node["fields"].items()})
    if "float" in node:
        return float(node["float"])
    if "dict" in node:
        return {from_tree(key, arrays): from_tree(one, arrays) for key, one in node["dict"]}
    (kind,) = node.keys() & (_CONTAINERS.keys() | _ARRAYS.keys())
    if kind in _CONTAINERS:
        return _CONTAINERS[kind](from_tree(one, arrays) for one in node[kind])
    return _ARRAYS[kind](arrays[node[kind]].reshape(node["shape"]))


_CONTAINERS: dict[str, Callable[[Any], Any]] = {"tuple": tuple, "list": list, "frozenset": frozenset}
_ARRAYS: dict[str, Callable[[np.ndarray], Any]] = {
    "jax": jnp.asarray,
    "numpy": lambda array: array,
    "scalar": lambda array: array[()],
}


def _made(kind: type, fields: Mapping[str, Any]) -> Any:
    """An object of a dataclass from all of its fields.

    `__init__` is skipped, as JAX does where it unflattens: batches have other shapes than their annotations say.
    """
    if fields.keys() != {one.name for one in dataclasses.fields(kind)}:
        raise ValueError(f"{kind.__name__} has other fields")
    made = object.__new__(kind)
    for name, value in fields.items():
        object.__setattr__(made, name, value)
    return made


def _class(name: str) -> type:
    """A dataclass of this package by module and name."""
    module, _, path = name.partition(":")
    if module.split(".")[0] != _PACKAGE or not path.isidentifier():
        raise ValueError(f"{name} is no class of {_PACKAGE}")
    found = getattr(importlib.import_module(module), path)
    if not (isinstance(found, type) and dataclasses.is_dataclass(found) and found.__module__ == module):
        raise ValueError(f"{name} is no state")
    return found
