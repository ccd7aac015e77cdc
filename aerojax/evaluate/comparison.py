"""The table of a comparison of classifiers, from what each of its runs has left."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from aerojax.core.files import write_json, write_text
from aerojax.evaluate.ablation import ablation_markdown, ablation_rows, over_seeds
from aerojax.evaluate.markdown import mean_cell, table_lines
from aerojax.evaluate.network_table import image_rows, network_markdown, network_rows
from aerojax.evaluate.rotations import PROTOCOLS

RESULT = "comparison.json"
"""What a run of `compare_classifiers` writes last."""

TITLES = {"last_frame": "last frame", "clip": "clip", "gain": "gain"}


def comparison_rows(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row a classifier, in the order in which the names first come: figures as mean and deviation over seeds.

    Args:
        runs: contents of `comparison.json`, each of another classifier or seed.

    Returns:
        Rows with accuracies (0..1) as `{"mean": …, "std": …}`; `std` is the sample standard deviation, None for one
        seed.
    """
    rows = []
    for name in dict.fromkeys(run["classifier"] for run in runs):
        group = [run for run in runs if run["classifier"] == name]
        first = group[0]
        rows.append(
            {
                "classifier": name,
                **{key: first[key] for key in ("mode", "bridge", "temporal", "trained", "parameters")},
                "seeds": sorted(run["seed"] for run in group),
                "minutes": float(np.mean([run["minutes"] for run in group])),
                "protocols": {
                    p.name: over_seeds([run["protocols"][p.name]["clip_accuracy"] for run in group]) for p in PROTOCOLS
                },
                **{key: over_seeds([run[key] for run in group]) for key in TITLES},
            }
        )
    return rows


def table_markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows as two Markdown tables: by the features that are read, and by the bridge of E(X). Accuracy in %."""
    features = [row for row in rows if row["bridge"] == "vn_in"]
    bridges = [row for row in rows if row["mode"] == "X" and row["temporal"] != "none"]
    trained = " or ".join(sorted({row["trained"] for row in rows}))
    lines = [
        "Clip accuracy in % on identities that training never saw, mean ± standard deviation over seeds.",
        f"The protocols turn the test clips; the rotation of the training clips was `{trained}`, and the loss of an",
        "exactly invariant model does not see it. Last frame: the last frame of each clip alone; gain: clip less last",
        "frame. `E_X_last_frame` was trained to answer from that frame.",
    ]
    for kind, chosen in (("features", features), ("bridge", bridges)):
        lines += ["", *_lines(kind, chosen)] if chosen else []
    return "\n".join(lines) + "\n"


def _lines(kind: str, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    names = [p.name for p in PROTOCOLS]
    head = ["classifier", kind, "parameters", *names, *TITLES.values(), "seeds", "minutes"]
    lines = []
    for row in rows:
        figures = [row["protocols"][name] for name in names] + [row[key] for key in TITLES]
        cells = [row["classifier"], row["mode" if kind == "features" else "bridge"], f"{row['parameters']:,}"]
        cells += [*map(mean_cell, figures), str(len(row["seeds"])), f"{row['minutes']:.1f}"]
        lines.append(cells)
    return table_lines(head, lines)


TABLES = {
    "features": (comparison_rows, table_markdown),
    "steps": (ablation_rows, ablation_markdown),
    "studies": (ablation_rows, ablation_markdown),
    "reconstructors": (ablation_rows, ablation_markdown),
    "baselines": (network_rows, network_markdown),
    "images": (image_rows, ablation_markdown),
}
"""By the kind of rows: what makes them of runs, and Markdown of them."""


def write_table(folder: Path, command: str) -> str:
    """Write `table.json` and `table.md` of the ended runs below a folder; return the Markdown, "" if there are none.

    Args:
        folder: of the sweep.
        command: what began it, for `table.json`.
    """
    runs = [json.loads(path.read_text()) for path in sorted(folder.rglob(RESULT))]
    if not runs:
        return ""
    rows_of, markdown_of = TABLES[runs[0]["rows"]]
    rows = rows_of(runs)
    origin = {"command": command, "date": datetime.now(UTC).isoformat(timespec="seconds")}
    origin |= {"commits": sorted({str(run["commit"]) for run in runs}), "machine": runs[0]["machine"]}
    write_json(folder / "table.json", {**origin, "runs": len(runs), "rows": rows})
    text = markdown_of(rows)
    write_text(folder / "table.md", text)
    return text
