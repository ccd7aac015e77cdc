"""Checkpoints by orbax's manager: the newest one of a run, whole or not there.

A state is saved as arrays under the names of its leaves, with no classes inside; restoring needs a state of the same
leaves. Saving waits until the file is there: 0.2 s for 300 leaves, once in hundreds of steps.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any, TypeVar

import jax
import numpy as np
import orbax.checkpoint as ocp

from aerojax.core.errors import UserError

_State = TypeVar("_State")
_PREFIX = "step"
_ENTRY_BYTES, _BASE_BYTES = 4096, 2**18
"""What a checkpoint takes beside its arrays: for each of them, and for the whole."""


def save_state(folder: Path, step: int, state: Any) -> None:
    """Write `state` as checkpoint `step` and remove older ones; a kill leaves the older one whole.

    One process calls it, also where several train together.

    Raises:
        OSError: the disk is full.
    """
    named = _named(state)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _require_space(folder, sum(leaf.nbytes + _ENTRY_BYTES for leaf in named.values()) + _BASE_BYTES)
        with _manager(folder, clean=True) as manager:
            manager.save(step, args=ocp.args.PyTreeSave(named), force=True)
    except ValueError as error:  # what tensorstore says of a full disk too
        if shutil.disk_usage(folder).free > sum(leaf.nbytes for leaf in named.values()):
            raise
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder)) from error


def _require_space(folder: Path, size: int) -> None:
    """Ask for the space before the checkpoint does, also of a quota.

    Of many arrays that are written at once, the first that fails ends orbax's event loop, and each of the others then
    complains about that with a traceback from a thread of its own.

    Raises:
        OSError: there is no such space.
    """
    allocate = getattr(os, "posix_fallocate", None)  # where there is none, the checkpoint itself tells
    with tempfile.NamedTemporaryFile(dir=folder, prefix=".space_") as file:
        try:
            if allocate is not None:
                allocate(file.fileno(), 0, size)
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EDQUOT):  # others say that this file system does not allocate
                raise OSError(error.errno, error.strerror, str(folder)) from None


def latest_step(folder: Path) -> int | None:
    """The newest complete checkpoint, if there is one; also while another process writes and removes them.

    Names alone decide: orbax gives a checkpoint its name when it is whole, and the manager would look into folders that
    a training process removes at the same moment.
    """
    steps = [path.name.removeprefix(f"{_PREFIX}_") for path in folder.glob(f"{_PREFIX}_*")]
    return max((int(step) for step in steps if step.isdigit()), default=None)


def restore_state(folder: Path, step: int, like: _State) -> _State:
    """Read checkpoint `step` into the structure of `like`, as NumPy arrays.

    Raises:
        UserError: if the checkpoint holds other leaves than `like`.
    """
    wanted = _named(like)
    with _manager(folder) as manager:
        stored = manager.item_metadata(step)
        found = {name: (leaf.shape, leaf.dtype) for name, leaf in stored.tree.items()} if stored else None
        if found != {name: (leaf.shape, leaf.dtype) for name, leaf in wanted.items()}:
            raise UserError(
                "mismatch",
                f"{folder}: checkpoint {step} belongs to another model, optimiser or training set",
                "use a new run directory or the old ones",
            )
        arrays = manager.restore(step, args=ocp.args.PyTreeRestore(wanted))
    return jax.tree.unflatten(jax.tree.structure(like), [arrays[name] for name in wanted])


def _named(state: Any) -> dict[str, np.ndarray]:
    """The leaves by the paths that lead to them, in order."""
    return {jax.tree_util.keystr(path): np.asarray(leaf) for path, leaf in jax.tree.leaves_with_path(state)}


def _manager(folder: Path, *, clean: bool = False) -> ocp.CheckpointManager:
    """For this process alone: of several, the others neither write nor wait. `clean` removes what a kill left."""
    this = jax.process_index()
    alone = ocp.options.MultiprocessingOptions(
        primary_host=this, active_processes={this}, barrier_sync_key_prefix=f"process_{this}"
    )
    options = ocp.CheckpointManagerOptions(
        max_to_keep=1,
        step_prefix=_PREFIX,
        step_format_fixed_length=8,
        create=False,
        cleanup_tmp_directories=clean,
        enable_async_checkpointing=False,
        multiprocessing_options=alone,
    )
    handler = ocp.PyTreeCheckpointHandler(multiprocessing_options=alone)
    return ocp.CheckpointManager(folder.resolve(), options=options, item_handlers=handler)
