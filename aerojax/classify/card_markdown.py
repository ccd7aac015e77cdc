"""The card of a trained classifier, and what lies beside its weights, as pages for people."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from aerojax.classify.card import Card

_TURNED = {
    "none": "never turned",
    "z": "each turned about +Z at random in every epoch",
    "so3": "each turned at random in every epoch (uniformly over SO(3))",
}


def card_markdown(card: Card, parameters: int) -> str:
    """Markdown of a card: what the classifier is, how it is read, what made it and how good it is.

    Args:
        card: with what `train_classifier` leaves in its record; an empty record gives the first part alone.
        parameters: how many numbers the weights hold.
    """
    record: dict[str, Any] = json.loads(card.record or "{}")
    lines = [f"# {card.name}", "", f"Classifier of clips, {parameters:,} parameters."]
    lines += _origin(record) if "command" in record else []
    clips = f"clips of {', '.join(record['clips'])}" if "clips" in record else "clips"
    lines += [
        f"Trained on {clips}, {_TURNED[card.rotation]},",
        f"in windows of {card.frames} frames with {card.tokens} tokens each; up to {card.token_ensembles} disjoint",
        f"subsets of a frame's tokens are read and averaged. Positions are divided by: {card.scale_normalisation}.",
        "Licence: Apache-2.0.",
    ]
    if card.settings:
        lines += ["", "Settings of the pipeline that made the clips:", ""]
        lines += [f"- `{key}={value}`" for key, value in card.settings]
    return "\n".join(lines + (_results(card, record) if "test" in record else [])) + "\n"


def _origin(record: dict[str, Any]) -> list[str]:
    return [
        f"Made by `{record['command']}`",
        f"(seed {record['seed']}, commit {record['commit']})",
        f"in {record['minutes']:.0f} minutes on {record['machine']['cpus']} CPU cores.",
    ]


def _results(card: Card, record: dict[str, Any]) -> list[str]:
    test = record["test"]
    recall = [f"| {label} | {_share(value)} |" for label, value in zip(card.classes, test["recall"], strict=True)]
    confusion = [
        f"| **{label}** | " + " | ".join(str(count) for count in row) + " |"
        for label, row in zip(card.classes, test["confusion"], strict=True)
    ]
    return [
        "",
        f"Test on {test['clips']} clips of {record['test_identities']} identities that training never saw:",
        f"accuracy {_share(test['accuracy'])}, macro-F1 {_share(test['macro_f1'])}.",
        "",
        "| class | recall |",
        "|---|---|",
        *recall,
        "",
        "| truth \\ answer | " + " | ".join(card.classes) + " |",
        "|---" * (len(card.classes) + 1) + "|",
        *confusion,
    ]


def familiarity_markdown(name: str, record: Mapping[str, Any]) -> str:
    """The page beside a familiarity: what it was fitted to, and how well validation outliers are told.

    Args:
        name: of the classifier.
        record: of `save_familiarity`.
    """
    lines = [f"# Familiarity of {name}", "", "Which objects look like those that the classifier was trained on."]
    lines += [
        f"Made by `{record['command']}`",
        f"(seed {record['seed']}, commit {record['commit']})",
        f"from {record['training_clips']} training and {record['validation_clips']} validation clips of",
        f"{', '.join(record['clips'])}.",
        "Licence: Apache-2.0.",
    ]
    if found := record["validation"]:
        kinds = [f"| {kind} | {_share(share)} |" for kind, share in found["strange_by_group"].items()]
        known = [f"| {label} | {_share(share)} |" for label, share in found["known_by_class"].items()]
        lines += [
            "",
            f"On validation families and {sum(found['outliers'].values())} clips of kinds by which it was chosen:",
            f"area under the ROC curve {found['auroc']:.3f}. Called unknown at a level of {found['level']:g}:",
            "",
            *("| clips of | called unknown |", "|---|---|", *kinds, *known),
        ]
    return "\n".join(lines) + "\n"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"
