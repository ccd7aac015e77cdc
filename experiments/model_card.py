"""The card that lies beside trained weights: which command made them and how good they are."""

from __future__ import annotations

from typing import Any

from aerojax.types import CLASSES


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
        f"MambaSplat-4D classifier, exact variant, {parameters:,} parameters; input: clips of visual-hull Gaussians.",
        f"Made by `{command}` (seed {results['seed']}, commit {results['commit']}) in {results['minutes']:.0f} minutes, clips",
        f"included, on {machine['cpus']} CPU cores. Trained on simulated identities only; licence Apache-2.0.",
        "",
        f"Test: {test['clips']} clips of {results['test_identities']} simulated identities of families that training never",
        f"saw: accuracy {_share(test['accuracy'])}, macro-F1 {_share(test['macro_f1'])}.",
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


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"
