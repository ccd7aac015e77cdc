"""Jobs in order: results as the jobs came, few ahead, the end of an endless list."""

from __future__ import annotations

import itertools
import time

import pytest

from aerojax.core.workers import run_in_order


def slower_first(number: int) -> int:
    time.sleep(0.2 if number == 0 else 0.0)
    return number * number


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_jobs(workers):
    taken = itertools.count()
    jobs = (next(taken) for _ in itertools.count())
    results = run_in_order(slower_first, jobs, workers=workers)
    assert list(itertools.islice(results, 5)) == [0, 1, 4, 9, 16]
    results.close()
    assert next(taken) <= 5 + 2 * workers  # no more than was asked for and `ahead`
