"""The player's part of the page as it stands before any script runs: the first frame that was used."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from typing import Any

from aerojax.view.report.content import ClassificationReport
from aerojax.view.report.findings import frame_strip
from aerojax.view.report.player import Step, plot_step
from aerojax.view.svg import curves
from aerojax.view.templates import fill, read_template
from aerojax.view.viewer.scene import first_yaw
from aerojax.view.viewer.still import still_uri

_BESIDE = 6
"""Cameras that stand beside the scene; more stand below it, over the page's whole width."""


def player_section(report: ClassificationReport, steps: Sequence[Step], data: Mapping[str, Any]) -> str:
    """Slider, scene, curve and pictures; nothing where no frame was used.

    Args:
        report: what the page shows. steps: positions of the slider. data: from `player_data`.
    """
    first = next((index for index, step in enumerate(steps) if step.used), None)
    if first is None:
        return '<section class="card"><p class="quiet">No frame gives a place: there is nothing to show.</p></section>'
    frame, shown = steps[first].used, data["steps"][first]
    assert frame is not None  # it is the first one that was used
    names = data["cameras"]
    parts = {
        "strip": frame_strip(steps),
        "now": f"frame {frame.frame}",
        "detail": f"{len(frame.splats.mean)} Gaussians",
        "arrangement": "beside" if len(names) <= _BESIDE else "below",
        "still": still_uri(frame.splats, data["scene"]["radius"], first_yaw(report.rig, frame.centre)),
        "curve": _curve(report),
        "columns": str(columns_of(len(names))),
        "cameras": "".join(_picture(index, name, shown["crops"].get(name)) for index, name in enumerate(names)),
    }
    return fill(read_template("report/player.html"), parts)


def columns_of(cameras: int) -> int:
    """Columns of wide pages in which the pictures fill two rows; an odd number of them begins with a large one."""
    return max(2, math.ceil((cameras + 3 * (cameras % 2)) / 2))


def _curve(report: ClassificationReport) -> str:
    """Probabilities over the frames with a legend whose values follow the slider."""
    every = plot_step(report.frames)
    plotted = report.frames[::every]
    names = list(report.probabilities)
    series = {name: [float(frame.probabilities[i]) for frame in plotted] for i, name in enumerate(names)}
    rows = "".join(
        f'<li><svg viewBox="0 0 26 10" aria-hidden="true"><path class="curve s{i}" d="M2 5h22"/></svg>'
        f'{html.escape(name)} <b class="value">{100 * series[name][0]:.1f} %</b></li>'
        for i, name in enumerate(names)
    )
    drawn = curves(
        "probability so far, over the frames", [frame.frame for frame in plotted], series, "probability so far"
    )
    return f'{drawn}<ul class="legend">{rows}</ul>'


def _picture(index: int, name: str, crop: Mapping[str, Any] | None) -> str:
    shown = crop or {"size": (1, 1), "full": (1, 1), "outline": "", "object": None, "box": None}
    parts = {
        "absent": "" if crop else "absent",
        "name": html.escape(name),
        "index": str(index),
        "source": f'src="{crop["jpeg"]}"' if crop else "",
        "outline": shown["outline"],
        "size": "{} {}".format(*shown["size"]),
        "full": "{} {}".format(*shown["full"]),
        "object": _rectangle(shown["object"]),
        "box": _rectangle(shown["box"]),
    }
    return fill(read_template("report/camera.html"), parts)


def _rectangle(corners: Sequence[int | float] | None) -> str:
    x0, y0, x1, y1 = corners or (0, 0, 0, 0)
    return f'x="{max(0, x0):g}" y="{max(0, y0):g}" width="{max(0, x1 - x0):g}" height="{max(0, y1 - y0):g}"'
