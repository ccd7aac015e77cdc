"""What a trained reconstructor is, as a page for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_FIGURES = {
    "psnr_db": "PSNR on the object, dB",
    "surround_psnr_db": "PSNR on the object and around it, dB",
    "ssim": "SSIM",
}


def card_markdown(name: str, record: Mapping[str, Any]) -> str:
    """Markdown: what made a member's parameters, of what, and how good they are on validation scenes.

    Args:
        name: of the member.
        record: of `train_reconstructor`, as it lies in the header of the weights.
    """
    scenes, found = record["scenes"], record["validation"]
    spent = "in more than one run" if record["minutes"] is None else f"in {record['minutes']:.0f} minutes"
    rows = [
        f"| {what} | {found[f'start_{key}']:.2f} | {found[key]:.2f} |"
        if f"start_{key}" in found
        else f"| {what} | | {found[key]:.2f} |"
        for key, what in _FIGURES.items()
    ]
    lines = [
        f"# {name}",
        "",
        f"Reconstructor of one frame's crops, {record['parameters']:,} parameters.",
        f"Made by `{record['command']}`",
        f"(seed {record['seed']}, commit {record['commit']})",
        f"{spent} on {record['machine']['cpus']} CPU cores.",
        f"Trained on {scenes['train']:,} scenes of {scenes['size']} pixels in {', '.join(scenes['views'])},",
        "half of training families, half of solids of no class. Licence: Apache-2.0.",
        "",
        f"Target views of {scenes['val']} validation scenes, of families and solids that training never saw:",
        "",
        "| | start | answer |",
        "|---|---|---|",
        *rows,
    ]
    return "\n".join(lines) + "\n"
