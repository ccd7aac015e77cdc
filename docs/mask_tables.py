"""Tables and plots of masks that are found without masks: overlap, ghosts, labels, and how many cameras must agree."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import mean, median
from typing import Any

import numpy as np
from result_cells import ABSENT, load, markdown, measured

from aerojax.view.dataset.plots import Curve, Labels, curve_plot, standalone

FOUND = {
    "measure_segmentation": "a third of a second, clutter",
    "measure_segmentation_second": "a second, no clutter",
    "measure_segmentation_second_sim3": "a second, no clutter",
    "measure_segmentation_second_clutter": "a second, clutter",
}
"""Results of measure_segmentation, and what their captures are."""
CONSENSUS = "measure_segmentation_consensus"
Rows = Sequence[dict[str, Any]]


def _of(rows: Rows, key: str) -> list[float]:
    """Values of the captures that have any: those without an image in which the object is large enough have none."""
    return [row[key] for row in rows if row[key] is not None]


def found_masks() -> str:
    """Overlap and ghosts of masks that were found, and labels by them and by those of the captures."""
    lines = []
    for name, what in FOUND.items():
        every = load(name)["rows"] if measured(name) else []
        for rig in sorted({row["capture"].split("_")[0] for row in every}):
            rows = [row for row in every if row["capture"].startswith(f"{rig}_")]
            overlap, missed = _of(rows, "median_iou"), _of(rows, "missed")
            figures = [f"{median(overlap):.2f}", f"{100 * mean(missed):.0f} %"] if overlap else ["", ""]
            ghosts = f"{mean(_of(rows, 'ghosts_in_100')):.1f}"
            lines.append([f"{rig}, {what}", len(rows), len(overlap), *figures, ghosts, *_labels(rows)])
    head = [
        "captures",
        "number",
        "large enough",
        "IoU",
        "missed",
        "ghosts in 100",
        "labelled",
        "right",
        "by given masks",
    ]
    return markdown(head, lines) if lines else ABSENT


def _labels(rows: Rows) -> list[Any]:
    """How many captures are labelled by the masks that were found, and right by these and by given ones; if asked."""
    if "label_found" not in rows[0]:
        return ["", "", ""]
    right = [sum(row[f"label_{which}"] == row["true"] for row in rows) for which in ("found", "given")]
    return [sum(row["label_found"] is not None for row in rows), *right]


def _consensus() -> dict[tuple[int, int], Rows]:
    """Rows by how many cameras there are and how many must agree; more than there are cannot."""
    rows = load(CONSENSUS)["rows"]
    pairs = sorted({(row["cameras"], row["views"]) for row in rows if row["views"] <= row["cameras"]})
    return {pair: [row for row in rows if (row["cameras"], row["views"]) == pair] for pair in pairs}


def consensus() -> str:
    """How many cameras must agree, of how many."""
    lines = []
    for (cameras, views), rows in _consensus().items():
        figures = [f"{mean(_of(rows, 'median_iou')):.2f}", f"{100 * mean(_of(rows, 'missed')):.0f} %"]
        lines.append([cameras, views, *figures, f"{mean(_of(rows, 'ghosts_in_100')):.1f}"])
    return markdown(["cameras", "must agree", "IoU", "missed", "ghosts in 100"], lines)


def consensus_plots() -> dict[str, str]:
    """Ghosts and missed images over how many cameras must agree, a curve for every number of cameras."""
    found = _consensus()

    def curves(key: str, scale: float) -> dict[str, Curve]:
        by_cameras: dict[str, Curve] = {}
        for count in sorted({cameras for cameras, _ in found}):
            views = [views for cameras, views in found if cameras == count]
            values = [scale * mean(_of(found[count, one], key)) for one in views]
            by_cameras[f"{count} cameras"] = Curve(np.array(views, float), np.array(values, float))
        return by_cameras

    plots = {
        "consensus_ghosts": ("Ghosts", "ghosts in 100 frames", curves("ghosts_in_100", 1.0)),
        "consensus_missed": ("Images in which an object was missed", "% of the images", curves("missed", 100.0)),
    }
    agree = "cameras that must agree"
    return {
        f"plots/{name}.svg": standalone(curve_plot(Labels(title, agree, y), lines))
        for name, (title, y, lines) in plots.items()
    }
