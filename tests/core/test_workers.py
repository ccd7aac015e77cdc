"""Jobs in order: results as the jobs came, few ahead, the end of an endless list; and workers that are killed."""

from __future__ import annotations

import itertools
import time

import pytest
from support.mortal_jobs import squared_or_dead

from aerojax.core.workers import run_in_order, run_surviving


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


@pytest.mark.parametrize("workers", [1, 2])
def test_what_a_killed_worker_was_at_is_done_again(workers, tmp_path):
    found = dict(run_surviving(squared_or_dead, [(tmp_path, n) for n in range(6)], workers=workers))
    assert found == {0: 0, 1: 1, 2: 4, 3: None, 4: 16, 5: 25}
    assert list(run_surviving(squared_or_dead, [], workers=workers)) == []
    with pytest.raises(FileNotFoundError):
        list(run_surviving(squared_or_dead, [(tmp_path / "nowhere", 0)], workers=workers))
