"""Plots of what frames, their order and the distance do: accuracy after each frame, by distance, and shuffled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from aerojax.view.dataset.plots import Curve, Labels, curve_plot, standalone


def temporal_plots(name: str, figures: Mapping[str, Any], classes: Sequence[str]) -> dict[str, str]:
    """SVG files by name of a classifier's `evaluate.temporal.temporal_figures`.

    Args:
        name: of the classifier, for titles.
        figures: its figures.
        classes: a curve each.

    Returns:
        Plots by frames, distance, order, and both; those of distance only where distances are known.
    """
    frames = {one: _curve(figures["prefixes"], one, "frames") for one in classes}
    away = {one: _curve(figures["distance_m"], one, "to_m") for one in classes}
    order = {
        "in order": _curve(figures["distance_m"], "all", "to_m"),
        "shuffled": _curve(figures["distance_m"], "all", "to_m", "when_shuffled"),
    }
    apart = figures["frames_by_distance"]
    grid = {
        f"{row['from_m']:g} to {row['to_m']:g} m": Curve(
            np.arange(1, len(row["accuracy"]) + 1.0), np.array(row["accuracy"])
        )
        for row in apart[:: max(len(apart) - 1, 1)]
    }
    share = "share of right answers"
    plots = {
        "frames": (Labels(f"{name}: accuracy after each frame", "frames", share), frames),
        "distance": (Labels(f"{name}: accuracy by distance", "metres, up to", share), away),
        "shuffled": (Labels(f"{name}: frames in order and shuffled", "metres, up to", share), order),
        "frames_by_distance": (Labels(f"{name}: after each frame, near and far", "frames", share), grid),
    }
    drawn = {key: pair for key, pair in plots.items() if all(len(curve.x) for curve in pair[1].values()) and pair[1]}
    return {key: standalone(curve_plot(labels, curves)) for key, (labels, curves) in drawn.items()}


def _curve(rows: Sequence[Mapping[str, Any]], group: str, x: str, y: str = "accuracy") -> Curve:
    chosen = [row for row in rows if row["class"] == group]
    return Curve(np.array([row[x] for row in chosen], float), np.array([row[y] for row in chosen], float))
