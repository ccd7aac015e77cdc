"""Accuracy against faults as one SVG file: a panel a factor, levels evenly spaced, bars for 95 % intervals."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

from aerojax.view.templates import read_template

PANEL, TALL, COLUMNS = 340, 220, 3
"""Pixels of a panel, and panels side by side."""
_LEFT, _RIGHT, _TOP, _BOTTOM = 56, 12, 30, 30
_TICKS = (0.0, 0.25, 0.5, 0.75, 1.0)
_WANTED = 0.8
"""Accuracy that is asked for under small faults; a dashed line."""


def robustness_svg(curves: Mapping[str, Sequence[Mapping[str, Any]]], titles: Mapping[str, str]) -> str:
    """Curves of accuracy as the text of an SVG file.

    Args:
        curves: rows of `evaluate.robustness.robustness_rows` by factor, a panel each, in order.
        titles: of the factors.

    Dots are accuracies, thin lines their 95 % intervals, pale columns the share of clips that could not be drawn.
    """
    rows = -(-len(curves) // COLUMNS) or 1
    width, height = PANEL * min(COLUMNS, max(len(curves), 1)), TALL * rows
    parts = []
    for place, (factor, levels) in enumerate(curves.items()):
        x, y = PANEL * (place % COLUMNS), TALL * (place // COLUMNS)
        parts.append(f'<g transform="translate({x} {y})">{_panel(titles.get(factor, factor), levels)}</g>')
    size = f'width="{width}" height="{height}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" class="plot" {size} viewBox="0 0 {width} {height}" role="img"'
    style = f"<style>{read_template('dataset/plot.css')}</style>"
    name = 'aria-label="accuracy against faults"'
    return f'{head} {name}>{style}<rect {size} fill="#fff"/>{"".join(parts)}</svg>\n'


def _panel(title: str, levels: Sequence[Mapping[str, Any]]) -> str:
    slot = (PANEL - _LEFT - _RIGHT) / max(len(levels), 1)
    xs = [_LEFT + (place + 0.5) * slot for place in range(len(levels))]
    parts = [f'<text x="8" y="18">{html.escape(title)}</text>', _grid()]
    for x, row in zip(xs, levels, strict=True):
        low, high = (_y(share) for share in row["interval_95"])
        lost = _y(0.0) - _y(row["undrawn"])
        label = html.escape(row["what"] or f"{row['value']:g}")
        parts.append(
            f'<rect class="f1 band" x="{x - 6:.1f}" y="{_y(row["undrawn"]):.1f}" width="12" height="{lost:.1f}"/>'
        )
        parts.append(f'<line class="s0" x1="{x:.1f}" y1="{low:.1f}" x2="{x:.1f}" y2="{high:.1f}"/>')
        parts.append(f'<circle class="f0" cx="{x:.1f}" cy="{_y(row["accuracy"]):.1f}" r="3"/>')
        parts.append(f'<text x="{x:.1f}" y="{TALL - _BOTTOM + 17}" text-anchor="middle">{label}</text>')
    line = " ".join(f"{x:.1f},{_y(row['accuracy']):.1f}" for x, row in zip(xs, levels, strict=True))
    return "".join([*parts, f'<polyline class="curve s0" points="{line}"/>'])


def _grid() -> str:
    parts, right = [], PANEL - _RIGHT
    for share in _TICKS:
        y = _y(share)
        parts.append(f'<line class="grid" x1="{_LEFT}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}"/>')
        parts.append(f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{100 * share:g} %</text>')
    y = _y(_WANTED)
    return "".join([*parts, f'<line class="mark" x1="{_LEFT}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}"/>'])


def _y(share: float) -> float:
    return TALL - _BOTTOM - share * (TALL - _TOP - _BOTTOM)
