"""How a stream's time, memory, handles and threads grow, and a table of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from aerojax.pipeline.soak import Soaked


def _slope(values: list[float], frames: list[int]) -> float:
    """Of the second half, a 10,000 frames: the first one warms up."""
    half = len(values) // 2
    line = np.polyfit(frames[half:], values[half:], 1) if len(values) - half > 1 else np.zeros(2)
    return float(10_000 * line[0])


def growth_of(windows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """How time, memory, handles and threads grow, a 10,000 frames."""
    frames, names = [window["frames"] for window in windows], ("step_ms", "resident_mb", "handles", "threads")
    return {name: _slope([float(window[name]) for window in windows], frames) for name in names}


def figures_of(soaked: Soaked) -> dict[str, Any]:
    """JSON-ready, with how memory, handles and time grow."""
    windows = [asdict(window) for window in soaked.windows]
    return {**asdict(soaked), "windows": windows, "growth_in_10000_frames": growth_of(windows)}


def show(figures: dict[str, Any], console: Console) -> None:
    """A row for every tenth of the stream."""
    table = Table("frames", "ms a step", "slowest, ms", "MB", "handles", "threads")
    windows = figures["windows"]
    for window in windows[:: max(len(windows) // 10, 1)]:
        times = (f"{window[name]:.2f}" for name in ("step_ms", "slowest_ms"))
        rest = (f"{window['resident_mb']:.0f}", window["handles"], window["threads"])
        table.add_row(str(window["frames"]), *times, *map(str, rest))
    console.print(table)
    if "drift" in figures:
        console.print(f"largest change of a probability over {figures['compared']} passes: {figures['drift']:.1e}")
