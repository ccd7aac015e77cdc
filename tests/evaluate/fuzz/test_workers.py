"""A reader that misbehaves is found, whatever it does; one that answers or refuses is not."""

from __future__ import annotations

import time

import numpy as np
import pytest
from support.fuzz_targets import read_or_misbehave

from aerojax.evaluate.fuzz.campaign import cases
from aerojax.evaluate.fuzz.workers import Limits, Tally, Target, Worker, changed_files, run_case

TARGET = Target(({"a.bin": b"0123"},), read_or_misbehave)
KINDS = {"0": "read", "r": "refused", "s": "silent", "t": "KeyError", "m": "memory", "w": "forbidden", "d": "forbidden"}


@pytest.mark.parametrize("first", [*KINDS, "p"])
def test_how_a_case_ended(tmp_path, first):
    kind, where = run_case(TARGET, {"a.bin": first.encode()}, tmp_path / "case")
    assert kind == KINDS.get(first, "forbidden")
    if first == "t":
        assert "KeyError" in where and where.splitlines()[-1].endswith("read_or_misbehave")
    if first in "wdp":
        assert {"w": "left left", "d": "os.mkdir", "p": "pickle.find_class"}[first] in where


def test_a_case_is_the_same_again():
    one, again, other = (changed_files(TARGET, "x", seed, 5) for seed in (1, 1, 2))
    assert one == again != other
    drawn = [next(c) for c in [cases({"a": 1.0, "b": 3.0}, 0)] * 400]
    assert [case for _, case in drawn] == list(range(400))
    assert 0.6 < np.mean([name == "b" for name, _ in drawn]) < 0.9


def test_findings_of_one_place_are_one():
    tally = Tally()
    for case in range(3):
        tally.add("ply", case, ("KeyError", "KeyError: 'x'\na.py:3 f"))
    tally.add("ply", 3, ("read", ""))
    (found,) = tally.findings.values()
    assert (found.case, tally.found["ply"], tally.inputs) == (0, 3, 4)


def answer(worker: Worker) -> tuple[str, str]:
    end = time.monotonic() + 120
    while time.monotonic() < end:
        if (found := worker.outcome()) is not None:
            return found
        time.sleep(0.01)
    raise AssertionError("no answer")


def wait_until_idle(worker: Worker) -> None:
    while not worker.idle:
        worker.outcome()
        time.sleep(0.01)


CLOSE = Target(({"a.bin": b"("}, {"a.bin": b"#"}), read_or_misbehave)
"""One bit away from `h` and `c`, so that few cases have to be looked at."""


@pytest.mark.slow
def test_a_process_that_hangs_or_dies_is_replaced(tmp_path):
    wanted: dict[bytes, int] = {}
    for case in range(2000):
        wanted.setdefault(changed_files(CLOSE, "x", 0, case)["a.bin"][:1], case)
    worker = Worker({"x": CLOSE}, tmp_path, 0, Limits(seconds=1.0))
    try:
        for first, kind in ((b"h", "hang"), (b"c", "crash"), (b"(", "read")):
            wait_until_idle(worker)
            worker.ask("x", wanted[first])
            assert answer(worker)[0] == kind
    finally:
        worker.stop()
