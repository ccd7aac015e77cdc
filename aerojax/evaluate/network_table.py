"""The rows of a comparison of networks: each turned as the protocols turn it, and on whole clips beside one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from aerojax.evaluate.ablation import VALIDATION, ablation_rows, over_seeds
from aerojax.evaluate.markdown import interval_cell, mean_cell, table_lines
from aerojax.evaluate.rotations import TEST_ROTATIONS

REFERENCE = "E_X"
"""The row that other networks are held against."""
WHOLE = "views"
"""The row that networks on single crops are held against: it reads images together and over time."""
NAMES = {"none": "none", "z": "z", "so3": "SO(3)", "so3_per_frame": "SO(3) a frame"}


def network_rows(runs: Sequence[Mapping[str, Any]], *, seed: int = 0, draws: int = 2000) -> list[dict[str, Any]]:
    """One row a classifier, as `ablation_rows`, with accuracies by the rotation of the test clips.

    Args:
        runs: contents of `comparison.json` of the rows `baselines`, each of another classifier or seed.
        seed, draws: of the bootstrap over individuals.

    Returns:
        JSON-ready rows; `trained` is the rotation of the training clips, `turned` the accuracy of windows by that of
        the test clips, with the interval over individuals (the mean of the seeds' ends), `last_frame` that of their
        last frames alone, `difference` the row's accuracy less that of `REFERENCE` on the same clips.
    """
    rows = ablation_rows(_held_against(REFERENCE, runs), seed=seed, draws=draws)
    for row in rows:
        group = [run for run in runs if run["classifier"] == row["classifier"]]
        turned = {kind: _turned([run["figures"]["rotations"][kind] for run in group]) for kind in TEST_ROTATIONS}
        row |= {"trained": group[0]["trained"], "windows": group[0]["windows"], "turned": turned}
        row |= {"last_frame": over_seeds([run["last_frame"] for run in group])}
    return rows


def image_rows(runs: Sequence[Mapping[str, Any]], *, seed: int = 0, draws: int = 2000) -> list[dict[str, Any]]:
    """One row a classifier, as `ablation_rows`, of networks that no rotation of the world concerns.

    Args:
        runs: contents of `comparison.json` of the rows `images`, each of another classifier or seed.
        seed, draws: of the bootstrap over individuals.

    Returns:
        JSON-ready rows; all others are held against `WHOLE`.
    """
    named = [{**run, "change": run["label"]} for run in runs]
    return ablation_rows(_held_against(WHOLE, named), seed=seed, draws=draws)


def _held_against(row: str, runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [{**run, "against": "" if run["classifier"] == row else row} for run in runs]


def _turned(rotations: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    ends = np.mean([one["interval_95"]["video_accuracy"] for one in rotations], axis=0)
    return {**over_seeds([one["clip_accuracy"]["mean"] for one in rotations]), "interval_95": ends.tolist()}


def network_markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows as two Markdown tables: turned windows, and whole clips by folder. Accuracy in %."""
    folders = [name for name in rows[0]["tests"] if name not in ("all", VALIDATION)]
    turned = [
        [
            row["classifier"],
            row["label"],
            f"{row['parameters']:,}",
            row["trained"],
            *(mean_cell(row["turned"][kind]) for kind in TEST_ROTATIONS),
            mean_cell(row["last_frame"]),
            f"{len(row['seeds'])}",
            f"{row['minutes']:.1f}",
        ]
        for row in rows
    ]
    whole = [
        [
            row["classifier"],
            f"{mean_cell(row['tests']['all']['accuracy'])} {interval_cell(*row['tests']['all']['interval_95'])}",
            _less(row["difference"]),
            *(mean_cell(row["tests"][name]["accuracy"]) for name in folders),
        ]
        for row in rows
    ]
    head = ["row", "network", "parameters", "trained turned", *(f"tested {NAMES[k]}" for k in TEST_ROTATIONS)]
    lines = [
        f"All rows: {rows[0]['steps']} steps on the same {rows[0]['training_clips']:,} clips. Windows of individuals",
        "that training never saw, turned; accuracy in %, mean ± standard deviation over seeds.",
        "",
        *table_lines([*head, "last frame", "seeds", "minutes"], turned),
        "",
        "Whole clips of every folder, not turned; in brackets the 95 % interval over individuals.",
        "",
        *table_lines(["row", "all, %", f"less {REFERENCE}", *folders], whole),
    ]
    return "\n".join(lines) + "\n"


def _less(gap: Mapping[str, float] | None) -> str:
    return "" if gap is None else f"{100 * gap['accuracy']:+.1f} {interval_cell(gap['low'], gap['high'], how='+.1f')}"
