"""Numbers of networks by name, on disk as safetensors, read strictly."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from aerojax.core.errors import UserError
from aerojax.core.files import write_bytes

_Tree = TypeVar("_Tree")


def parameter_names(tree: Any) -> list[tuple[str, Any]]:
    """Dotted names and leaves of a network, or of a tree shaped like one (its gradient, its shapes)."""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return [(jax.tree_util.keystr(p, simple=True, separator=".").removesuffix(".value"), leaf) for p, leaf in leaves]


def is_statistic(name: str) -> bool:
    """Whether a leaf of this name is a running statistic of a batch norm: kept with the parameters, and none itself."""
    return name.rsplit(".")[-1].startswith("running_")


def statistics(tree: Any) -> Any:
    """For every leaf of a network whether it is a running statistic."""
    return jax.tree.unflatten(jax.tree.structure(tree), [is_statistic(name) for name, _ in parameter_names(tree)])


def parameter_count(tree: Any) -> int:
    """How many numbers of a network training optimises; running statistics are none of them."""
    return sum(leaf.size for name, leaf in parameter_names(tree) if not is_statistic(name))


def write_tensors(path: Path, network: Any, header: Mapping[str, str]) -> None:
    """Write a network's parameters by name; the file is complete or absent, never half written.

    Args:
        path: usually `*.safetensors`.
        network: a pytree of arrays.
        header: texts kept beside them.
    """
    tensors = {name: np.ascontiguousarray(leaf) for name, leaf in parameter_names(network)}
    write_bytes(path, save(tensors, metadata=dict(header)))


def read_tensors(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Tensors by name, and the header.

    Raises:
        UserError: the file is absent, or no complete safetensors file.
    """
    if not path.is_file():
        raise UserError("missing", f"weights file {path} does not exist", "train a model or correct the path")
    try:
        with safe_open(path, framework="numpy") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except (SafetensorError, TypeError) as error:
        raise UserError(
            "unreadable", f"{path} is not a complete safetensors file of numbers ({error})", "fetch or write it again"
        ) from None


def filled(shapes: _Tree, tensors: Mapping[str, np.ndarray], path: Path, *, whose: str) -> _Tree:
    """A network of given shapes with the tensors of a file.

    Args:
        shapes: the network with `jax.ShapeDtypeStruct`s for parameters, as `jax.eval_shape` gives it.
        tensors: by name.
        path: where they come from, for messages.
        whose: what says which shapes there should be, such as "its own card".

    Raises:
        UserError: names every tensor that is missing, unknown, of another shape or type, or not finite.
    """
    expected = dict(parameter_names(shapes))
    if problems := _problems(tensors, expected):
        raise UserError("invalid", "\n  ".join([f"{path} does not fit {whose}:", *problems]), "fetch it again")
    return jax.tree.unflatten(jax.tree.structure(shapes), [jnp.asarray(tensors[name]) for name in expected])


def _problems(tensors: Mapping[str, np.ndarray], expected: Mapping[str, jax.ShapeDtypeStruct]) -> list[str]:
    """Everything for which the tensors are not those of the model, in words."""
    problems = [f"missing tensor {name}" for name in expected if name not in tensors]
    problems += [f"unknown tensor {name}" for name in tensors if name not in expected]
    for name, wanted in expected.items():
        found = tensors.get(name)
        if found is None:
            continue
        if found.shape != wanted.shape or found.dtype != wanted.dtype:
            problems.append(f"tensor {name} is {found.dtype} {found.shape}, expected {wanted.dtype} {wanted.shape}")
        elif not np.isfinite(found).all():
            problems.append(f"tensor {name} holds numbers that are not finite")
    return problems
