"""Accuracy against one fault at a time, on the same clips at every level: rows and their Markdown table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from aerojax.core.types import CLASSES
from aerojax.evaluate.bootstrap import accuracy, paired_interval
from aerojax.evaluate.groups import AnsweredClips, answer_figures, confusions

TITLES = {
    "ideal": "nothing is wrong",
    "calibration_deg": "calibration error (°, standard deviation)",
    "clock_ms": "clock error (ms, largest)",
    "mask_growth": "mask dilated (pixels; eroded where negative)",
    "cameras": "cameras",
    "width_px": "width of the object (pixels)",
    "distance_m": "distance (m)",
    "combined": "combined",
}
"""What the levels of a factor are, as tables and plots say it."""


@dataclass(frozen=True, eq=False)
class LevelAnswers:
    """Answers at one level; `what` names it in a table where `factor` and `value` do not say enough."""

    factor: str
    value: float
    answers: AnsweredClips
    what: str = ""


def robustness_rows(
    ideal: AnsweredClips, levels: Sequence[LevelAnswers], *, seed: int, draws: int
) -> list[dict[str, Any]]:
    """Figures of every level, and its difference from the ideal one on the same individuals.

    Args:
        ideal: answers where nothing is wrong.
        levels: of the same clips; those that a fault makes impossible are among them as missing.
        seed, draws: of the bootstraps.

    Returns:
        JSON-ready rows of `answer_figures`, with `factor`, `value`, `undrawn` (share of the clips that the fault left
        too few usable frames of), `difference` of the accuracies and its 95 % interval over individuals.
    """
    first, before = confusions(ideal), answer_figures(ideal, seed=seed, draws=draws)["accuracy"]
    rows = []
    for level in levels:
        figures = answer_figures(level.answers, seed=seed, draws=draws)
        apart = paired_interval(confusions(level.answers), first, accuracy, seed=seed, draws=draws)
        rows.append(
            {"factor": level.factor, "value": level.value, "what": level.what}
            | figures
            | {"undrawn": figures["missing"] / figures["clips"]}
            | {"difference": figures["accuracy"] - before, "difference_95": list(apart)}
        )
    return rows


def robustness_markdown(rows: Sequence[Mapping[str, Any]], *, about: str) -> str:
    """The rows of `robustness_rows` as one Markdown table; figures in %.

    Args:
        rows: in order.
        about: a sentence on the weights and the clips, above the table.
    """
    head = ["fault", "level", "accuracy", "95 %", "change", "95 %", "not drawn", "ECE", *CLASSES]
    lines = [about, "", "| " + " | ".join(head) + " |", "|---" * 2 + "|---:" * (len(head) - 2) + "|"]
    for row in rows:
        low, high = row["interval_95"]
        change = [f"{100 * share + 0.0:+.1f}" for share in (row["difference"], *row["difference_95"])]
        cells = [TITLES.get(row["factor"], row["factor"]), row["what"] or f"{row['value']:g}"]
        cells += [_percent(row["accuracy"]), f"{_percent(low)} … {_percent(high)}"]
        cells += [change[0], f"{change[1]} … {change[2]}"]
        cells += [_percent(row["undrawn"]), "-" if row["ece"] is None else f"{row['ece']:.3f}"]
        lines.append("| " + " | ".join([*cells, *map(_percent, row["recall"])]) + " |")
    closing = "Change: from the ideal. A clip that a fault leaves too few usable frames of counts as wrong."
    closing += " Intervals are over individuals."
    return "\n".join([*lines, "", closing]) + "\n"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f}"
