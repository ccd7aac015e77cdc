"""Cost of every classifier member beside its accuracy: the rows of `measure_cost`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
from rich.table import Table

from aerojax.classify.base import Trainable, untrained
from aerojax.classify.load import load_classifier
from aerojax.classify.members import MEMBERS
from aerojax.core.errors import UserError
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.cost import member_cost


def chosen_members(weights: Sequence[Path], names: Sequence[str], *, seed: int) -> dict[str, Trainable]:
    """The shipped classifier, those in files, and members with random weights and the shipped one's tokens and frames.

    Raises:
        UserError: there is no such member.
    """
    if unknown := set(names) - set(MEMBERS):
        raise UserError("invalid", f"untrained names {', '.join(sorted(unknown))}", f"choose of {', '.join(MEMBERS)}")
    shipped, key = load_classifier(), jax.random.key(seed)
    found = {"shipped": shipped, **{str(path): load_classifier(path) for path in weights}}
    sizes = {"tokens": shipped.card.tokens, "frames": shipped.card.frames}
    return found | {f"untrained {name}": untrained(MEMBERS[name](), key=key, **sizes) for name in names}


def member_row(
    name: str, classifier: Trainable, config: PipelineConfig, *, views: int, repeats: int, seed: int
) -> dict[str, Any]:
    """`member_cost` with what the card says of the accuracy on its test clips, None where it says nothing."""
    record = json.loads(classifier.card.record or "{}")
    head = {"name": name, "member": classifier.card.member, "label": classifier.card.name}
    head |= {"accuracy": record.get("test", {}).get("accuracy")}
    return head | member_cost(classifier, config, views=views, repeats=repeats, seed=seed)


def member_table(rows: Sequence[dict[str, Any]]) -> Table:
    """Milliseconds a frame, and the stage's time as a multiple of the first row's."""
    table = Table("classifier", "member", "parameters", "accuracy %", "step ms", "clip ms", "stage ms", "of the first")
    for row in rows:
        share = None if row["stage_ms"] is None else row["stage_ms"] / rows[0]["stage_ms"]
        figures = (row["step_ms"], row["clip_ms"], row["stage_ms"], share)
        cells = ["-" if value is None else f"{value:.2f}" for value in figures]
        accuracy = "-" if row["accuracy"] is None else f"{100 * row['accuracy']:.1f}"
        table.add_row(Path(row["name"]).name, row["member"], f"{row['parameters']:,}", accuracy, *cells)
    return table
