"""Where the time of a frame goes."""

from __future__ import annotations

import time
from collections import defaultdict, deque
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

REMEMBERED = 1000
"""Times a stage that are kept: a stream never ends, its memory must."""


class Stopwatch:
    """Wall-clock milliseconds by stage name, of the last frames."""

    def __init__(self) -> None:
        self._spent: defaultdict[str, deque[float]] = defaultdict(lambda: deque(maxlen=REMEMBERED))

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time of the block to `name`."""
        start = time.perf_counter()
        yield
        self._spent[name].append(1e3 * (time.perf_counter() - start))

    def medians(self) -> dict[str, float]:
        """The median of each stage; robust against the first call, which compiles."""
        return {name: float(np.median(times)) for name, times in self._spent.items()}
