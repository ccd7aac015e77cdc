"""The one look of progress bars."""

from __future__ import annotations

from collections.abc import Callable

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text


class _RateColumn(ProgressColumn):
    """Steps a second so far."""

    def __init__(self, unit: str):
        super().__init__()
        self._unit = unit

    def render(self, task: Task) -> Text:
        return Text(f"{task.finished_speed or task.speed or 0.0:.1f} {self._unit}")


def progress_bar(unit: str | None = None) -> Progress:
    """A bar with count, elapsed and remaining time, on standard error so that results can be piped.

    Args:
        unit: such as "images/s"; shows the rate in it.
    """
    columns: tuple[ProgressColumn, ...] = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    return Progress(*columns, *([_RateColumn(unit)] if unit else []), console=Console(stderr=True))


def shown_in(bar: Progress) -> Callable[[int, int, str], None]:
    """Draw progress as one row of a bar a kind of work: a callback for the library."""
    rows: dict[str, TaskID] = {}

    def show(done: int, total: int, what: str) -> None:
        if what not in rows:
            rows[what] = bar.add_task(what, total=total)
        bar.update(rows[what], completed=done, total=total)

    return show
