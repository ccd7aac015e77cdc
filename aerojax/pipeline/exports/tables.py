"""The track of a clip as CSV and as JSON lines."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from aerojax.core.files import json_text, write_text
from aerojax.core.types import CLASSES
from aerojax.pipeline.results import point_json
from aerojax.pipeline.track_points import TrackPoint

COLUMNS = (
    *("frame", "time_s", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "length_m", "width_m", "height_m"),
    "label",
    *(f"p_{name}" for name in CLASSES),
    *("latitude_deg", "longitude_deg", "height_above_ellipsoid_m"),
    "answer",
)
"""Of the CSV file; what is not known is empty. `label` is the likeliest class so far, `answer` the whole clip's."""


def export_csv(points: Sequence[TrackPoint], answer: str | None, path: Path) -> Path:
    """One line a frame, after a line with the columns; `answer` as `answer_of` has it."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    nothing = ("", "", "")
    for point in points:
        probabilities = [point.probabilities[name] for name in CLASSES]
        known = (*point.position, *(point.velocity or nothing), *(point.size or nothing))
        place = point.place or nothing
        writer.writerow([point.frame, point.time_s, *known, point.label, *probabilities, *place, answer])
    write_text(path, text.getvalue())
    return path


def export_jsonl(points: Sequence[TrackPoint], answer: str | None, path: Path) -> Path:
    """One JSON object a line: a point of the track of `result.json`, its label so far, and the whole clip's answer."""
    lines = [json_text({**point_json(point), "label": point.label, "answer": answer}, indent=None) for point in points]
    write_text(path, "".join(lines))
    return path
