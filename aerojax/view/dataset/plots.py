"""Plots of a data set's description: curves with bands, grouped bars and heat maps; SVG text or PNG bytes."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from aerojax.view.svg import nice_ticks
from aerojax.view.templates import read_template

WIDTH, HEIGHT = 520, 300
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 14, 34, 44


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of a curve, and optionally how far a band reaches to either side of it, in units of y."""

    x: Float[np.ndarray, "point"]
    y: Float[np.ndarray, "point"]
    band: Float[np.ndarray, "point"] | None = None


@dataclass(frozen=True)
class Labels:
    """Texts of a plot: accessible name, horizontal and vertical axis."""

    name: str
    x: str
    y: str


def standalone(plot: str) -> str:
    """A plot as the content of an SVG file."""
    head, rest = plot.split(">", 1)
    size = f'width="{WIDTH}" height="{HEIGHT}"'
    style = f"<style>{read_template('dataset/plot.css')}</style>"
    return f'{head} xmlns="http://www.w3.org/2000/svg" {size}>{style}<rect {size} fill="#fff"/>{rest}\n'


def curve_plot(labels: Labels, curves: Mapping[str, Curve], *, marks: Sequence[float] = (), colour: int = 0) -> str:
    """Curves over numbers, one colour a curve (four, from number `colour` on), with dashed lines at x of `marks`."""
    tops = [c.y + (0 if c.band is None else c.band) for c in curves.values()]
    highest = max((float(np.nanmax(top)) for top in tops if top.size), default=1.0) or 1.0
    every_x = np.concatenate([c.x for c in curves.values()] or [np.zeros(1)])
    low, high = float(every_x.min()), max(float(every_x.max()), float(every_x.min()) + 1e-9)

    def place(x: float, y: float) -> tuple[float, float]:
        u, v = (x - low) / (high - low), y / (1.05 * highest)
        return _LEFT + u * (WIDTH - _LEFT - _RIGHT), HEIGHT - _BOTTOM - v * (HEIGHT - _TOP - _BOTTOM)

    parts = [_y_grid(labels, highest, place(low, 0.0)[1])]
    for tick in nice_ticks(low, high, 8):
        parts.append(
            f'<text x="{place(tick, 0.0)[0]:.1f}" y="{HEIGHT - _BOTTOM + 17}" text-anchor="middle">{tick:g}</text>'
        )
    for index, curve in enumerate(curves.values(), colour):
        if curve.band is not None:
            upper = [place(x, y) for x, y in zip(curve.x, curve.y + curve.band, strict=True)]
            lower = [place(x, max(y, 0.0)) for x, y in zip(curve.x, curve.y - curve.band, strict=True)]
            parts.append(f'<polygon class="band f{index % 4}" points="{_points(upper + lower[::-1])}"/>')
        line = [place(x, y) for x, y in zip(curve.x, curve.y, strict=True)]
        parts.append(f'<polyline class="curve s{index % 4}" points="{_points(line)}"/>')
    for mark in marks:
        x = place(mark, 0.0)[0]
        parts.append(f'<line class="mark" x1="{x:.1f}" y1="{_TOP}" x2="{x:.1f}" y2="{HEIGHT - _BOTTOM}"/>')
    return _drawing(labels, "".join(parts) + _legend(list(curves), colour))


def bar_plot(labels: Labels, bins: Sequence[str], series: Mapping[str, Sequence[float]]) -> str:
    """Bars side by side in each bin, one colour a series (four)."""
    highest = max((max(values, default=0.0) for values in series.values()), default=0.0) or 1.0
    slot = (WIDTH - _LEFT - _RIGHT) / max(len(bins), 1)
    bar = 0.84 * slot / max(len(series), 1)
    bottom = float(HEIGHT - _BOTTOM)
    parts = [_y_grid(labels, highest, bottom)]
    for place, name in enumerate(bins):
        x = _LEFT + (place + 0.5) * slot
        parts.append(f'<text x="{x:.1f}" y="{bottom + 17:g}" text-anchor="middle">{html.escape(name)}</text>')
    for index, values in enumerate(series.values()):
        for place, value in enumerate(values):
            x = _LEFT + place * slot + 0.08 * slot + index * bar
            tall = value / (1.05 * highest) * (bottom - _TOP)
            box = f'x="{x:.1f}" y="{bottom - tall:.1f}" width="{bar:.1f}" height="{tall:.1f}"'
            parts.append(f'<rect class="f{index % 4}" {box}/>')
    return _drawing(labels, "".join(parts) + _legend(list(series)))


def _points(places: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places if np.isfinite(x) and np.isfinite(y))


def _y_grid(labels: Labels, highest: float, bottom: float) -> str:
    parts = []
    for tick in nice_ticks(0.0, highest, 5):
        y = bottom - tick / (1.05 * highest) * (HEIGHT - _TOP - _BOTTOM)
        parts.append(f'<line class="grid" x1="{_LEFT}" y1="{y:.1f}" x2="{WIDTH - _RIGHT}" y2="{y:.1f}"/>')
        parts.append(f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    middle, across = (_TOP + bottom) / 2, (_LEFT + WIDTH - _RIGHT) / 2
    parts.append(f'<text x="{across}" y="{HEIGHT - 6}" text-anchor="middle">{html.escape(labels.x)}</text>')
    turned = f'transform="rotate(-90 13 {middle:.1f})"'
    parts.append(f'<text x="13" y="{middle:.1f}" text-anchor="middle" {turned}>{html.escape(labels.y)}</text>')
    return "".join(parts)


def _legend(names: Sequence[str], colour: int = 0) -> str:
    parts = []
    for index, name in enumerate(names):
        x = _LEFT + index * (WIDTH - _LEFT - _RIGHT) / max(len(names), 1)
        parts.append(f'<rect class="f{(index + colour) % 4}" x="{x:.1f}" y="11" width="11" height="11"/>')
        parts.append(f'<text x="{x + 16:.1f}" y="21">{html.escape(name)}</text>')
    return "".join(parts)


def _drawing(labels: Labels, body: str) -> str:
    name = html.escape(labels.name, quote=True)
    return f'<svg class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{name}">{body}</svg>'


def heat_png(heat: Float[np.ndarray, "rows columns"], *, cell: int = 6) -> bytes:
    """A heat map as a PNG of `cell` pixels a cell, dark = nothing, bright = the most; no axes."""
    scaled = np.round(255.0 * heat / max(float(heat.max()), 1e-12)).astype(np.uint8)
    coloured = cv2.applyColorMap(scaled, cv2.COLORMAP_INFERNO)
    large = cv2.resize(coloured, None, fx=cell, fy=cell, interpolation=cv2.INTER_NEAREST)
    done, data = cv2.imencode(".png", large)
    assert done  # encoding to memory fails only for shapes that the signature excludes
    return data.tobytes()
