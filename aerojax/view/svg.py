"""Small SVG plots as text: no script, no external reference; colours come from the page's style sheet."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

WIDTH, HEIGHT = 440, 260
_WIDE = (640, 230)
_LEFT, _RIGHT, _TOP, _BOTTOM = 54, 14, 12, 40


def nice_ticks(low: float, high: float, count: int = 5) -> list[float]:
    """About `count` round numbers (1, 2 or 5 times a power of ten apart) within [low, high]."""
    if not high > low:
        return [low]
    rough = (high - low) / count
    magnitude = 10.0 ** math.floor(math.log10(rough))
    step = magnitude * min((1, 2, 5, 10), key=lambda factor: abs(factor * magnitude - rough))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(index * step, 12) for index in range(first, last + 1)]


@dataclass(frozen=True)
class _Axes:
    """Linear maps from data to the drawing; y points up in the data and down in the drawing."""

    x: tuple[float, float]
    y: tuple[float, float]
    size: tuple[int, int] = (WIDTH, HEIGHT)

    def place(self, x: float, y: float) -> tuple[float, float]:
        u = (x - self.x[0]) / ((self.x[1] - self.x[0]) or 1.0)
        v = (y - self.y[0]) / ((self.y[1] - self.y[0]) or 1.0)
        width, height = self.size
        return _LEFT + u * (width - _LEFT - _RIGHT), height - _BOTTOM - v * (height - _TOP - _BOTTOM)

    def path(self, xs: Sequence[float], ys: Sequence[float]) -> str:
        """Pairs "x,y" of the finite points, separated by spaces."""
        points = [self.place(x, y) for x, y in zip(xs, ys, strict=True) if math.isfinite(x) and math.isfinite(y)]
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)

    def grid(self, x_label: str, y_label: str, y_ticks: Sequence[float] | None = None, whole_x: bool = False) -> str:
        parts = []
        width, height = self.size
        bottom, left, right = height - _BOTTOM, _LEFT, width - _RIGHT
        for tick in (tick for tick in nice_ticks(*self.x) if not whole_x or tick == round(tick)):
            x, _ = self.place(tick, self.y[0])
            parts.append(f'<line class="grid" x1="{x:.1f}" y1="{_TOP}" x2="{x:.1f}" y2="{bottom}"/>')
            parts.append(f'<text x="{x:.1f}" y="{bottom + 17}" text-anchor="middle">{tick:g}</text>')
        for tick in nice_ticks(*self.y) if y_ticks is None else y_ticks:
            _, y = self.place(self.x[0], tick)
            parts.append(f'<line class="grid" x1="{left}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}"/>')
            parts.append(f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
        middle = (_TOP + bottom) / 2
        parts.append(f'<text x="{(left + right) / 2}" y="{height - 4}" text-anchor="middle">{x_label}</text>')
        turned = f'transform="rotate(-90 12 {middle})"'
        parts.append(f'<text x="12" y="{middle}" text-anchor="middle" {turned}>{y_label}</text>')
        return "".join(parts)


def _drawing(name: str, axes: _Axes, body: str) -> str:
    label, (width, height) = html.escape(name), axes.size
    return f'<svg class="plot" viewBox="0 0 {width} {height}" role="img" aria-label="{label}">{body}</svg>'


def _cursor(places: str, mark: str) -> str:
    """A mark that the page's script moves to the selected frame's place."""
    first = places.split(" ")[0] if places else "0,0"
    return f'<g class="cursor" data-at="{places}" transform="translate({first})">{mark}</g>'


def curves(name: str, frames: Sequence[int], series: Mapping[str, Sequence[float]], y_label: str) -> str:
    """Wide curves of values in 0..1 over the frames, one class `s0`, `s1` … a curve, with a cursor line.

    Args:
        name: accessible name of the plot.
        frames: frame numbers, ascending, at least one.
        series: values by name, one a frame; what is not finite is left out.
        y_label: text at the vertical axis.
    """
    times = [float(frame) for frame in frames]
    axes = _Axes(_time_span(times), (0.0, 1.0), _WIDE)
    lines = []
    for index, values in enumerate(series.values()):
        lines.append(f'<polyline class="curve s{index}" points="{axes.path(times, values)}"/>')
    mark = f'<line class="now" x1="0" y1="{_TOP}" x2="0" y2="{axes.size[1] - _BOTTOM}"/>'
    cursor = _cursor(" ".join(f"{axes.place(time, 0.0)[0]:.1f},0" for time in times), mark)
    return _drawing(
        name, axes, axes.grid("frame", y_label, [0.0, 0.25, 0.5, 0.75, 1.0], whole_x=True) + "".join(lines) + cursor
    )


def height_curve(frames: Sequence[int], height: Sequence[float]) -> str:
    """Height over ground in metres over the frames; the range spans at least one metre."""
    times = [float(frame) for frame in frames]
    axes = _Axes(_time_span(times), _span(np.array(height), least=1.0))
    line = f'<polyline class="curve track" points="{axes.path(times, height)}"/>'
    cursor = _cursor(_all_places(axes, times, height), '<circle class="now" r="5"/>')
    return _drawing("height over the frames", axes, axes.grid("frame", "height z, m", whole_x=True) + line + cursor)


def top_view(positions: Float[np.ndarray, "frame 3"]) -> str:
    """The track from above, metres, x to the right and y up, both at the same scale; the start is a ring."""
    x, y = positions[:, 0].astype(np.float64), positions[:, 1].astype(np.float64)
    (x0, x1), (y0, y1) = _span(x, least=1.0), _span(y, least=1.0)
    aspect = (WIDTH - _LEFT - _RIGHT) / (HEIGHT - _TOP - _BOTTOM)
    reach_y = max(y1 - y0, (x1 - x0) / aspect) / 2
    middle_x, middle_y = (x0 + x1) / 2, (y0 + y1) / 2
    reach_x = reach_y * aspect
    axes = _Axes((middle_x - reach_x, middle_x + reach_x), (middle_y - reach_y, middle_y + reach_y))
    places = axes.path(x.tolist(), y.tolist())
    start = places.split(" ")[0].split(",") if places else ["0", "0"]
    line = f'<polyline class="curve track" points="{places}"/>'
    ring = f'<circle class="start" cx="{start[0]}" cy="{start[1]}" r="4"/>'
    cursor = _cursor(_all_places(axes, x.tolist(), y.tolist()), '<circle class="now" r="5"/>')
    return _drawing("track from above", axes, axes.grid("x, m", "y, m") + line + ring + cursor)


def _time_span(times: Sequence[float]) -> tuple[float, float]:
    return times[0], max(times[-1], times[0] + 1.0)


def _span(values: np.ndarray, least: float) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    margin = max(0.08 * (high - low), (least - (high - low)) / 2, 0.0)
    return low - margin, high + margin


def _all_places(axes: _Axes, xs: Sequence[float], ys: Sequence[float]) -> str:
    """One place a frame, also where the position is not finite (then the previous one), so that indices agree."""
    places: list[str] = []
    for x, y in zip(xs, ys, strict=True):
        places.append(axes.path([x], [y]) or (places[-1] if places else "-20,-20"))
    return " ".join(places)
