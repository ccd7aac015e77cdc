"""Tables of reconstructors, and pictures: a row a scene, the target first and then every member's rendering of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rich.table import Table

from aerojax.core.files import write_bytes
from aerojax.data.views import ViewSet
from aerojax.evaluate.reconstruction import FIGURES, targets_at

HEADING = 16
"""Rows above the pictures for the members' names."""

HEADINGS = {
    "psnr_db": "PSNR on it",
    "surround_psnr_db": "around",
    "full_psnr_db": "image",
    "ssim": "SSIM",
    "iou": "IoU",
    "perceptual": "perc.",
    "chamfer_percent": "Chamfer %",
    "gaussians": "Gaussians",
}
"""Of a table's columns."""


def condition_table(condition: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Mean figures of every member under one condition."""
    figures = [name for name in FIGURES if name in rows[0]]
    table = Table("member", *(HEADINGS[name] for name in figures), title=condition)
    for row in rows:
        table.add_row(row["member"], *(f"{row[n]:.0f}" if n == "gaussians" else f"{row[n]:.4g}" for n in figures))
    return table


def write_sheet(path: Path, scenes: ViewSet, pictures: Mapping[str, Sequence[np.ndarray]], *, most: int) -> None:
    """Write a PNG of the first scenes, each seen from a target of its own.

    Args:
        path: of the file.
        scenes: whose targets come first.
        pictures: by member, renderings of every scene's targets, 0..1.
        most: how many scenes.
    """
    rows = []
    for index in range(min(most, len(scenes))):
        target = index % scenes.target_mask.shape[1]
        true = np.asarray(targets_at(scenes, index).image)[target]
        rows.append(np.concatenate([true, *(seen[index][target] for seen in pictures.values())], axis=1))
    heading = np.full((HEADING, rows[0].shape[1], 3), 255, np.uint8)
    for column, name in enumerate(("target", *pictures)):
        at = (4 + column * scenes.size, HEADING - 5)
        cv2.putText(heading, name, at, cv2.FONT_HERSHEY_SIMPLEX, 0.38, (0, 0, 0), 1, cv2.LINE_AA)
    drawn = np.round(255 * np.clip(np.concatenate(rows), 0.0, 1.0)).astype(np.uint8)[..., ::-1]
    bgr = np.concatenate([heading, drawn])
    write_bytes(path, cv2.imencode(".png", bgr)[1].tobytes())
