"""Trained weights on disk, and the card beside them: which command made them and how good they are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jax

from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.weights import save_weights
from aerojax.core.types import CLASSES


def keep_model(
    directory: Path, model: MambaSplat, notes: dict[str, Any], results: dict[str, Any], *, command: str
) -> Path:
    """Write `weights.safetensors`, with `notes` as JSON in its header, and `weights.md`; return the weights' path."""
    weights = directory / "weights.safetensors"
    save_weights(weights, model, metadata={name: json.dumps(value) for name, value in notes.items()})
    size = sum(leaf.size for leaf in jax.tree.leaves(model))
    name = f"MambaSplat-4D E({model.config.mode}), {model.config.variant} variant"
    card = model_card(name, results, command=command, parameters=size)
    weights.with_suffix(".md").write_text(card)
    return weights


def model_card(name: str, results: dict[str, Any], *, command: str, parameters: int) -> str:
    """Markdown of a model card.

    Args:
        name: of the weights.
        results: what `train_classifier` writes to `metrics.json`.
        command: that made the weights.
        parameters: how many numbers they hold.
    """
    test, machine = results["test"], results["machine"]
    recall = [f"| {label} | {_share(value)} |" for label, value in zip(CLASSES, test["recall"], strict=True)]
    confusion = [
        f"| **{label}** | " + " | ".join(str(count) for count in row) + " |"
        for label, row in zip(CLASSES, test["confusion"], strict=True)
    ]
    lines = [
        f"# {name}",
        "",
        f"Classifier of clips of Gaussians, {parameters:,} parameters.",
        f"Made by `{command}`",
        f"(seed {results['seed']}, commit {results['commit']})",
        f"in {results['minutes']:.0f} minutes on {machine['cpus']} CPU cores.",
        f"Trained on clips of {', '.join(results['clips'])}, {_turned(results['trained']['variation']['rotation'])}.",
        f"Read as windows of {results['reading']['frames']} frames with {results['reading']['tokens']} tokens each.",
        "Licence: Apache-2.0.",
        "",
        f"Test on {test['clips']} clips of {results['test_identities']} identities that training never saw:",
        f"accuracy {_share(test['accuracy'])}, macro-F1 {_share(test['macro_f1'])}.",
        "",
        "| class | recall |",
        "|---|---|",
        *recall,
        "",
        "| truth \\ answer | " + " | ".join(CLASSES) + " |",
        "|---" * (len(CLASSES) + 1) + "|",
        *confusion,
    ]
    return "\n".join(lines) + "\n"


def _turned(rotation: str) -> str:
    return {
        "none": "never turned",
        "z": "each turned about +Z at random in every epoch",
        "so3": "each turned at random in every epoch (uniformly over SO(3))",
    }[rotation]


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"
