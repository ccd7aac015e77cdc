"""One training step on every device of one or several machines: the batch is divided, the weights are copied.

A single device needs none of it: then every function here hands on what it is given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import multihost_utils
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Int

from aerojax.core.errors import UserError

_Tree = TypeVar("_Tree")


@dataclass(frozen=True)
class DistributionConfig:
    """Which of how many processes this is, one a machine; a process alone uses the defaults.

    coordinator: `address:port` of process 0, as every other one reaches it.
    process: number of this one, from 0. Process 0 alone writes files.
    processes: how many there are.
    """

    coordinator: str | None = None
    process: int = 0
    processes: int = 1


def join_processes(config: DistributionConfig) -> None:
    """Wait for the other processes of the run; call it before anything else touches a device.

    Raises:
        UserError: the fields contradict each other.
    """
    if not 0 <= config.process < config.processes:
        raise UserError(
            "out-of-range",
            f"distribution.process={config.process} is none of distribution.processes={config.processes}",
            f"number them from 0 to {max(config.processes, 1) - 1}",
        )
    if config.processes == 1:
        return
    if config.coordinator is None:
        raise UserError(
            "out-of-range",
            "distribution.coordinator is not set",
            "give address:port of process 0, the same to every process",
        )
    jax.config.update("jax_cpu_collectives_implementation", "gloo")
    jax.distributed.initialize(config.coordinator, config.processes, config.process)


def is_first_process() -> bool:
    """Whether this process writes the run's files."""
    return jax.process_index() == 0


def own_share(index: Int[np.ndarray, "batch"]) -> Int[np.ndarray, "share"]:
    """The part of a batch that this process reads; together the processes read it once, in order."""
    return np.split(index, jax.process_count())[jax.process_index()]


def from_first_process(tree: _Tree) -> _Tree:
    """What process 0 holds, as NumPy arrays, in every process; structure and shapes are the same in all."""
    return multihost_utils.broadcast_one_to_all(tree)


@dataclass(frozen=True)
class Devices:
    """The devices of a step.

    mesh: all of them along one axis, `batch`; None if there is one.
    """

    mesh: Mesh | None

    def compile(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """`jax.jit` of a function whose results are wanted whole on every device."""
        return jax.jit(function) if self.mesh is None else jax.jit(function, out_shardings=self._sharding())

    def copy(self, tree: _Tree) -> _Tree:
        """The arrays of `tree`, equal in all processes, whole on every device."""
        if self.mesh is None:
            return jax.tree.map(jnp.asarray, tree)
        return jax.tree.map(lambda leaf: self._place(leaf, self._sharding()), tree)

    def divide(self, batch: _Tree) -> _Tree:
        """This process' share of a batch, divided over its devices along the leading axis."""
        if self.mesh is None:
            return batch
        return jax.tree.map(lambda leaf: self._place(leaf, self._sharding("batch")), batch)

    def own_copy(self, tree: _Tree) -> _Tree:
        """The arrays of `copy`, as this process alone can use them, on one device."""
        return tree if self.mesh is None else jax.tree.map(lambda leaf: leaf.addressable_data(0), tree)

    def _sharding(self, *axes: str) -> NamedSharding:
        assert self.mesh is not None
        return NamedSharding(self.mesh, PartitionSpec(*axes))

    def _place(self, leaf: Any, sharding: NamedSharding) -> jax.Array:
        return jax.make_array_from_process_local_data(sharding, np.asarray(leaf))


def devices_for(examples: int) -> Devices:
    """All devices of all processes, or as many of a single process' as divide `examples` evenly.

    Raises:
        UserError: the devices of several processes do not divide `examples` evenly.
    """
    devices = sorted(jax.devices(), key=lambda device: (device.process_index, device.id))
    if jax.process_count() == 1:
        devices = devices[: max(n for n in range(1, len(devices) + 1) if examples % n == 0)]
    elif examples % len(devices):
        raise UserError(
            "mismatch",
            f"training.batch over training.micro_batches is {examples}, which {len(devices)} "
            "devices do not divide evenly",
            f"make it a multiple of {len(devices)}",
        )
    return Devices(Mesh(np.array(devices), ("batch",)) if len(devices) > 1 else None)
