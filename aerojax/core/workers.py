"""Processes that fill the cores between them, deliver as they finish, and end with their parent however it ends."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

import cv2

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")

_FRUITLESS = 2
"""Pools one after the other that end without a result before jobs are tried one at a time."""


def run_jobs(work: Callable[[_Job], _Result], jobs: Iterable[_Job], *, workers: int) -> Iterator[_Result]:
    """Results of `work(job)` in the order in which they are ready; the first exception stops what has not begun.

    Args:
        work: a function of a module, since workers are spawned.
        jobs: picklable.
        workers: processes; 1 works in this one.
    """
    if workers <= 1:
        yield from map(work, jobs)
        return
    with _pool(workers) as pool:
        try:
            for done in as_completed([pool.submit(work, job) for job in jobs]):
                yield done.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def run_in_order(
    work: Callable[[_Job], _Result], jobs: Iterable[_Job], *, workers: int, ahead: int = 2
) -> Iterator[_Result]:
    """Results of `work(job)` in the order of the jobs; few are made before they are asked for.

    Args:
        work: a function of a module, since workers are spawned.
        jobs: picklable; they may be endless.
        workers: processes; 1 works in this one.
        ahead: jobs a worker that are handed out before the first of their results is taken.
    """
    if workers <= 1:
        yield from map(work, jobs)
        return
    waiting: deque[Future[_Result]] = deque()
    with _pool(workers) as pool:
        try:
            for job in jobs:
                waiting.append(pool.submit(work, job))
                if len(waiting) >= ahead * workers:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        except BaseException:  # whoever asks no more ends the pool too
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def run_surviving(
    work: Callable[[_Job], _Result], jobs: Sequence[_Job], *, workers: int
) -> Iterator[tuple[int, _Result | None]]:
    """Results of `work(job)` with the job's place, in the order in which they are ready, though workers may die.

    When one is killed, what it and the others were at is done again, behind what nobody was at. What is left when that
    leads nowhere is done a job at a time.

    Args:
        work: a function of a module, since workers are spawned; its first exception stops what has not begun.
        jobs: picklable.
        workers: processes; one too is spawned, so that every result is computed alike.

    Yields:
        Place and result; None for a job at which its worker died alone.
    """
    order, fruitless = list(range(len(jobs))), 0
    while order and fruitless < _FRUITLESS:
        done = set()
        for place, result in _until_one_dies(work, jobs, order, workers):
            done.add(place)
            yield place, result
        fruitless = 0 if done else fruitless + 1
        lost = [place for place in order if place not in done]
        order = lost[workers + 1 :] + lost[: workers + 1]  # a pool hands out one more than it has workers
    for place in order:
        yield place, dict(_until_one_dies(work, jobs, [place], 1)).get(place)


def _until_one_dies(
    work: Callable[[_Job], _Result], jobs: Sequence[_Job], order: Sequence[int], workers: int
) -> Iterator[tuple[int, _Result]]:
    with _pool(workers) as pool:
        try:
            futures = {pool.submit(work, jobs[place]): place for place in order}
            for done in as_completed(futures):
                try:
                    result = done.result()
                except BrokenProcessPool:
                    continue
                yield futures[done], result
        except BrokenProcessPool:  # while jobs were still handed in; what is ready is done again
            return
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _pool(workers: int) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=start_worker)


def start_worker() -> None:
    """Make a process that was spawned use one thread for its computations, and end with its parent."""
    cv2.setNumThreads(1)
    os.environ["XLA_FLAGS"] = (
        os.environ.get("XLA_FLAGS", "") + " --xla_cpu_multi_thread_eigen=false"
    )  # read at first use
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    multiprocessing.connection.wait([sentinel])
    os._exit(1)
