"""What a training shows while it runs: early losses, speed and time left on the screen, curves in a log."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rich.console import Console

from aerojax.training.distribution import is_first_process
from aerojax.training.loop import TrainingConfig
from aerojax.training.optimisers import learning_rate
from experiments._launch.progress import progress_bar
from experiments._launch.scalar_log import ScalarLog

_EARLY = 10
"""Steps of a run after which its speed, compilation left out, is told before the first epoch ends."""


class TrainingScreen:
    """The two listeners of `Fit`: `watch` for steps and `report` for epochs."""

    def __init__(self, console: Console, bar: tuple, config: TrainingConfig, steps: int, log: ScalarLog | None):
        self._console, (self._bar, self._task), self._log = console, bar, log
        self._epochs, self._steps = config.epochs, steps
        self._rate = learning_rate(config.optimiser, steps)
        self._begun: tuple[int, float] | None = None

    def watch(self, step: int, figures: dict[str, float]) -> None:
        """Show and log the figures of a step."""
        if self._begun is None:
            self._begun = step, time.perf_counter()
            self._console.print(f"step {step} of {self._steps}: loss {figures['loss']:.4g}")
        elif step - self._begun[0] == _EARLY:
            self._console.print(f"step {step} of {self._steps}: loss {figures['loss']:.4g}  {self._speed(step)}")
        self._bar.update(self._task, completed=step, description=f"loss {figures['loss']:.3f}")
        if self._log is not None:
            rate = {"learning_rate": float(np.asarray(self._rate(step - 1)))}
            self._log.write(step, {f"training/{name}": value for name, value in {**figures, **rate}.items()})

    def report(self, row: dict[str, float]) -> None:
        """Show and log the figures of an epoch."""
        step = round(row["epoch"] * self._steps / self._epochs)
        self._console.print("  ".join([*(f"{name} {value:.4g}" for name, value in row.items()), self._speed(step)]))
        if self._log is not None:
            self._log.write(step, {f"epoch/{name}": value for name, value in row.items() if name != "epoch"})

    def _speed(self, step: int) -> str:
        if self._begun is None or step == self._begun[0]:
            return ""
        rate = (step - self._begun[0]) / (time.perf_counter() - self._begun[1])
        return f"({rate:.2g} steps/s, {(self._steps - step) / rate / 60:.0f} min left)"


@contextmanager
def training_screen(config: TrainingConfig, steps_per_epoch: int, *, curves: Path | None) -> Iterator[TrainingScreen]:
    """A screen for one run; `curves` is the folder for TensorBoard, if any.

    Raises:
        UserError: curves are asked for and cannot be written.
    """
    steps = config.epochs * steps_per_epoch
    log = ScalarLog(curves) if curves is not None and is_first_process() else None
    with progress_bar("steps/s") as bar:
        try:
            yield TrainingScreen(Console(), (bar, bar.add_task("training", total=steps)), config, steps, log)
        finally:
            if log is not None:
                log.close()
