"""The state on disk, now and then, without holding up the frames: states are values, so a thread may write them."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from pathlib import Path

from aerojax.serve.state_files import ServiceState, write_service_state
from aerojax.serve.trees import NotStorable


class Saver:
    """Writes a state every `every_s` seconds in a thread of its own."""

    def __init__(self, path: Path, made_with: Mapping[str, str], every_s: float) -> None:
        self._path, self._made_with, self._every_s = path, made_with, every_s
        self._thread: threading.Thread | None = None
        self._last_s = time.monotonic()
        self._problems: set[str] = set()
        self._untold: list[str] = []

    def offer(self, state: ServiceState) -> None:
        """Write it if it is time, and the last one is written."""
        due = time.monotonic() - self._last_s >= self._every_s
        if due and (self._thread is None or not self._thread.is_alive()):
            self._last_s = time.monotonic()
            self._thread = threading.Thread(target=self._write, args=(state,), name="saver")
            self._thread.start()

    def finish(self, state: ServiceState) -> None:
        """Write the last state, now."""
        if self._thread is not None:
            self._thread.join()
        self._write(state)

    def problems(self) -> list[str]:
        """What could not be saved, each said once."""
        found, self._untold = self._untold, []
        return found

    def _write(self, state: ServiceState) -> None:
        try:
            lost = write_service_state(self._path, state, self._made_with)
            text = f"{lost} cannot be stored: after a restart the background is learnt anew" if lost else ""
        except NotStorable as error:
            text = f"{error} cannot be stored: a restart would begin anew"
        except OSError as error:
            text = f"{self._path}: {error.strerror or error}: a restart would go on from an older state"
        if text and text not in self._problems:
            self._problems.add(text)
            self._untold.append(text)
