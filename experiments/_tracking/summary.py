"""The figures of all rows of a kind: the middle one and the worst one of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from aerojax.evaluate.markdown import table_lines
from experiments._tracking.detections import Row
from experiments._tracking.recorded import count_answers

LEAST_IS_WORST = ("idf1",)
FIGURES = {
    "idf1": "IDF1",
    "gospa": "GOSPA, m",
    "rmse": "RMSE, m",
    "ghosts": "ghosts in 100",
    "switches": "switches",
    "missed": "missed",
    "offset_error_ms": "offset off by, ms",
    "offset_sigma_ms": "as reported, ms",
    "offset_bound_ms": "at best, ms",
    "offset_over_sigma": "error over reported",
    "offset_error_ends_ms": "at the ends, ms",
    "rmse_ratio": "RMSE over that of perfect clocks",
    "rotation_error_deg": "rotation off by, °",
    "position_error_m": "position off by, m",
    "pose_over_sigma": "error over reported",
    "changed": "cameras changed",
    "off_px": "sights off by, px",
    "then_px": "and then, px",
}
"""Keys of rows, and what people call them."""
COUNTS = "clocks", "offsets_right", "determined", "determined_right"
"""Keys of rows that are added up."""


def summary(rows: Mapping[str, Sequence[Row]]) -> dict[str, dict[str, Any]]:
    """By kind: how many scenes, the median and the worst of every figure, and answers where there are labels."""
    found: dict[str, dict[str, Any]] = {}
    for kind, some in rows.items():
        known = {key: np.array([row[key] for row in some], float) for key in FIGURES if key in some[0]}
        figures = {
            key: {
                "median": float(np.median(values)),
                "worst": float(values.min() if key in LEAST_IS_WORST else values.max()),
            }
            for key, values in known.items()
        }
        found[kind] = {"scenes": len(some), **figures}
        if COUNTS[0] in some[0]:
            found[kind]["offsets"] = {key: sum(row[key] for row in some) for key in COUNTS}
        if "tracks" in some[0]:
            found[kind]["answers"] = count_answers([track for row in some for track in row["tracks"]])
        if "answers" in some[0]:
            found[kind]["answers"] = _added([row["answers"] for row in some])
    return found


def _added(answers: Sequence[Mapping[str, Mapping[str, int]]]) -> dict[str, dict[str, int]]:
    return {name: {key: sum(one[name][key] for one in answers) for key in answers[0][name]} for name in answers[0]}


def table(found: Mapping[str, Mapping[str, Any]]) -> str:
    """A Markdown table of `summary`: median, and the worst in brackets."""
    head = ["rows", "scenes", *FIGURES.values()]
    rows = []
    for kind, figures in found.items():
        cells = [f"{figures[k]['median']:.3g} ({figures[k]['worst']:.3g})" if k in figures else "" for k in FIGURES]
        rows.append([kind, str(figures["scenes"]), *cells])
    return "\n".join(table_lines(head, rows))
