"""Processes that fill the cores between them, deliver as they finish, and end with their parent however it ends."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from typing import TypeVar

import cv2

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")


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


def _pool(workers: int) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker)


def _start_worker() -> None:
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
