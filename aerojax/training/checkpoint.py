"""Checkpoints by orbax, wrapped so that its changing interface touches one file.

A state is saved as its leaves in order, with no classes inside; restoring needs a state of the same structure. Leaves
of one type lie behind each other in one array, because orbax takes a millisecond for an array of whatever size.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any, TypeVar

import jax
import numpy as np
import orbax.checkpoint as ocp

from aerojax.core.errors import UserError

_State = TypeVar("_State")
_SHAPES = "shapes"


def save_state(folder: Path, step: int, state: Any) -> None:
    """Write `state` as checkpoint `step` and remove older ones; a kill leaves the older one whole.

    One process calls it, also where several train together.
    """
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(state)]
    arrays = {kind: np.concatenate([leaf.ravel() for leaf in same]) for kind, same in _by_type(leaves).items()}
    arrays[_SHAPES] = np.frombuffer(_shapes(leaves).encode(), np.uint8)
    folder.mkdir(parents=True, exist_ok=True)
    for broken in folder.glob("step_*.*"):  # left by a kill while writing
        shutil.rmtree(broken)
    with _checkpointer() as writer:
        writer.save(folder.resolve() / f"step_{step:08d}", arrays, force=True)
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
    with _checkpointer() as reader:
        arrays = {name: np.asarray(array) for name, array in reader.restore(path).items()}
    wanted, structure = jax.tree.flatten(like)
    leaves = [np.asarray(leaf) for leaf in wanted]
    if _SHAPES not in arrays or arrays[_SHAPES].tobytes() != _shapes(leaves).encode():
        raise UserError(
            "mismatch",
            f"{path} belongs to another model, optimiser or training set",
            "use a new run directory or the old ones",
        )
    ends = dict.fromkeys(arrays, 0)
    found = []
    for leaf in leaves:
        start, kind = ends[leaf.dtype.name], leaf.dtype.name
        ends[kind] = start + leaf.size
        found.append(arrays[kind][start : ends[kind]].reshape(leaf.shape))
    return jax.tree.unflatten(structure, found)


def _by_type(leaves: list[np.ndarray]) -> dict[str, list[np.ndarray]]:
    kinds = dict.fromkeys(leaf.dtype.name for leaf in leaves)
    return {kind: [leaf for leaf in leaves if leaf.dtype.name == kind] for kind in kinds}


def _shapes(leaves: list[np.ndarray]) -> str:
    return json.dumps([[leaf.dtype.name, *leaf.shape] for leaf in leaves])


def _checkpointer() -> ocp.Checkpointer:
    """For this process alone: of several, the others neither write nor wait."""
    this = jax.process_index()
    alone = ocp.options.MultiprocessingOptions(
        primary_host=this, active_processes={this}, barrier_sync_key_prefix=f"process_{this}"
    )
    handler = ocp.PyTreeCheckpointHandler(multiprocessing_options=alone)
    return ocp.Checkpointer(handler, multiprocessing_options=alone)


def _complete(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(p for p in folder.iterdir() if p.name.startswith("step_") and p.name.removeprefix("step_").isdigit())
