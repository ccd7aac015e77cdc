"""Checkpoints by orbax, wrapped so that its changing interface touches one file.

A state is saved as its leaves in order, with no classes inside; restoring needs a state of the same structure.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any, TypeVar

import jax
import numpy as np
import orbax.checkpoint as ocp

from aerojax.errors import UserError

_State = TypeVar("_State")


def save_state(folder: Path, step: int, state: Any) -> None:
    """Write `state` as checkpoint `step` and remove older ones; a kill leaves the older one whole."""
    leaves = {f"{index:05d}": np.asarray(leaf) for index, leaf in enumerate(jax.tree.leaves(state))}
    folder.mkdir(parents=True, exist_ok=True)
    with ocp.PyTreeCheckpointer() as writer:
        writer.save(folder.resolve() / f"step_{step:08d}", leaves, force=True)
    for old in _complete(folder)[:-1]:
        shutil.rmtree(old)


def latest_step(folder: Path) -> int | None:
    """The newest complete checkpoint, if there is one."""
    complete = _complete(folder)
    return int(complete[-1].name.removeprefix("step_")) if complete else None


def restore_state(folder: Path, step: int, like: _State) -> _State:
    """Read checkpoint `step` into the structure of `like`.

    Raises:
        UserError: if the checkpoint holds other leaves than `like`.
    """
    path = folder.resolve() / f"step_{step:08d}"
    with ocp.PyTreeCheckpointer() as reader:
        stored = reader.restore(path)
    wanted, structure = jax.tree.flatten(like)
    found = [np.asarray(stored[name]) for name in sorted(stored)]
    if [np.shape(w) for w in wanted] != [f.shape for f in found]:
        raise UserError(
            f"{path} belongs to another model or optimiser; use a new run directory or the old configuration"
        )
    return jax.tree.unflatten(structure, [f.astype(np.asarray(w).dtype) for f, w in zip(found, wanted, strict=True)])


def _complete(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(p for p in folder.iterdir() if p.name.startswith("step_") and p.name.removeprefix("step_").isdigit())
