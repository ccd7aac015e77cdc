"""What an answer stands on, as cards of the page: saliency of frames, and the answer without what is salient."""

from __future__ import annotations

import numpy as np

from aerojax.core.types import CLASSES
from aerojax.view.dataset.plots import Curve, Labels, curve_plot
from aerojax.view.report.content import ClassificationReport


def explanation_cards(report: ClassificationReport) -> dict[str, str]:
    """Plots by their titles; none where no explanation was asked for."""
    found = report.explanation
    if found is None:
        return {}
    frames = np.array([frame.frame for frame in report.frames[-len(found["frames"]) :]], float)
    name, share = CLASSES[found["label"]], np.array(found["frames"])
    weights = {name: Curve(frames, share / max(float(share.sum()), 1e-12))}
    fewer = np.array(found["without_frames"])
    removed = {name: Curve(np.arange(len(fewer), dtype=float), fewer)}
    cards = {
        "Frames that it stands on": curve_plot(Labels("saliency of frames", "frame", "share of saliency"), weights),
        "Without them": curve_plot(
            Labels("probability without frames", "frames left out, the most salient first", "probability"), removed
        ),
    }
    if "shares" in found:
        shares = 100 * np.array(found["shares"])
        names = {"deletion": "salient gone", "random": "random gone", "insertion": "salient alone"}
        curves = {said: Curve(shares, np.array(found[key])) for key, said in names.items()}
        labels = Labels("probability without Gaussians", "Gaussians of each frame, %", "probability")
        cards["Gaussians that it stands on"] = curve_plot(labels, curves)
    return cards
