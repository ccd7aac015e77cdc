"""Jobs on the actors of a Ray cluster, one process each, on as many machines as it has (extra `cluster`)."""

from __future__ import annotations

import importlib
import importlib.util
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from aerojax.core.errors import UserError
from aerojax.core.workers import start_worker

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")

ATTEMPTS = 3
"""Actors that a job may kill before it is given up."""


class _Actor:
    def __init__(self) -> None:
        start_worker()

    def run(self, work: Callable[[Any], Any], job: Any) -> Any:
        return work(job)


def require_ray() -> None:
    """Make sure that there is Ray.

    Raises:
        UserError: it is not installed.
    """
    if importlib.util.find_spec("ray") is None:
        raise UserError("unavailable", "cluster=ray needs the package ray", "pip install 'aerojax[cluster]'")


def run_on_ray(
    work: Callable[[_Job], _Result], jobs: Sequence[_Job], *, workers: int
) -> Iterator[tuple[int, _Result | None]]:
    """Results of `work(job)` with the job's place, as `core.workers.run_surviving` gives them.

    An actor whose process is killed starts anew, elsewhere if its machine is gone, and does its job again.

    Args:
        work: a function of a module that every machine has.
        jobs: picklable; paths in them must mean the same on every machine.
        workers: actors; each counts as one core when they are placed.

    Raises:
        UserError: Ray is not installed.
    """
    require_ray()
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is told to anybody
    ray: Any = importlib.import_module("ray")
    own = not ray.is_initialized()
    if own:
        ray.init(include_dashboard=False, log_to_driver=False)  # RAY_ADDRESS names a cluster; else one is started here
    try:
        kind = ray.remote(_Actor).options(max_restarts=-1, max_task_retries=ATTEMPTS - 1, scheduling_strategy="SPREAD")
        idle, places, pending = [kind.remote() for _ in range(workers)], iter(range(len(jobs))), {}
        while True:
            for actor, place in zip(tuple(idle), places, strict=False):  # an idle one first, or a place would be lost
                pending[actor.run.remote(work, jobs[place])] = place, idle.pop(0)
            if not pending:
                break
            (ready,), _ = ray.wait(list(pending), num_returns=1)
            place, actor = pending.pop(ready)
            idle.append(actor)
            yield place, _result(ray, ready)
    finally:
        if own:
            ray.shutdown()


def _result(ray: Any, ready: Any) -> Any:
    """What a job gave; None where its actors died at it."""
    try:
        return ray.get(ready)
    except ray.exceptions.RayActorError:
        return None
