"""Accuracies of the rows of a comparison as one SVG file: a dot a row, a line for its 95 % interval."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

from aerojax.view.templates import read_template

WIDTH, ROW = 560, 22
_LEFT, _RIGHT, _TOP, _BOTTOM = 170, 20, 14, 34
_TICKS = (0.0, 0.25, 0.5, 0.75, 1.0)


def comparison_svg(rows: Sequence[Mapping[str, Any]]) -> str:
    """Dots of accuracy with intervals as the text of an SVG file.

    Args:
        rows: of `evaluate.ablation.ablation_rows` or `evaluate.network_table.network_rows`; the accuracy is that of
            all counted clips, a mean over seeds.
    """
    height = _TOP + ROW * len(rows) + _BOTTOM
    size = f'width="{WIDTH}" height="{height}"'
    parts = [f'<rect {size} fill="#fff"/>', _grid(height - _BOTTOM)]
    for place, row in enumerate(rows):
        y, tests = _TOP + ROW * (place + 0.5), row["tests"]["all"]
        low, high = (_x(share) for share in tests["interval_95"])
        name = html.escape(row["classifier"])
        parts.append(f'<text x="{_LEFT - 10}" y="{y + 4:.1f}" text-anchor="end">{name}</text>')
        parts.append(f'<line class="s0" x1="{low:.1f}" y1="{y:.1f}" x2="{high:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<circle class="f0" cx="{_x(tests["accuracy"]["mean"]):.1f}" cy="{y:.1f}" r="4"/>')
    label = f'<text x="{_x(0.5):.1f}" y="{height - 4}" text-anchor="middle">share of right answers</text>'
    style = f"<style>{read_template('dataset/plot.css')}</style>"
    head = f'<svg xmlns="http://www.w3.org/2000/svg" class="plot" {size} viewBox="0 0 {WIDTH} {height}" role="img"'
    return f'{head} aria-label="accuracy of each row">{style}{"".join(parts)}{label}</svg>\n'


def _grid(bottom: int) -> str:
    parts = []
    for share in _TICKS:
        x = _x(share)
        parts.append(f'<line class="grid" x1="{x:.1f}" y1="{_TOP}" x2="{x:.1f}" y2="{bottom}"/>')
        parts.append(f'<text x="{x:.1f}" y="{bottom + 15}" text-anchor="middle">{100 * share:g} %</text>')
    return "".join(parts)


def _x(share: float) -> float:
    return _LEFT + share * (WIDTH - _LEFT - _RIGHT)
