"""Tracks as JSON Lines and CSV: one track in one moment a line."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from aerojax.core.files import json_text, write_text
from aerojax.track.following import Followed
from aerojax.track.offline import Following
from aerojax.track.sights import TimedCamera

COLUMNS = (
    *("time_s", "track", "status", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"),
    *("xx_m2", "xy_m2", "xz_m2", "yy_m2", "yz_m2", "zz_m2", "cameras"),
)
"""Of the CSV file; xx_m2 to zz_m2 are the covariance of the position."""


def point_to_json(time_s: float, one: Followed, cameras: Sequence[TimedCamera]) -> dict[str, Any]:
    """A track in one moment: seconds of the network's clock, metres, world; covariance of position and velocity."""
    return {
        "time_s": time_s,
        "track": one.number,
        "status": one.status,
        "position": one.mean[:3].tolist(),
        "velocity": one.mean[3:6].tolist(),
        "covariance": one.covariance[:6, :6].tolist(),
        "cameras": [cameras[index].name for index in sorted(one.seen)],
    }


def write_tracks(path: Path, following: Following, cameras: Sequence[TimedCamera]) -> None:
    """Write all tracks, moment by moment; the suffix says how, `.jsonl` or `.csv`."""
    points = [point_to_json(m.time_s, one, cameras) for m in following.moments for one in m.tracks]
    if path.suffix == ".csv":
        write_text(path, _csv(points))
    else:
        write_text(path, "".join(json_text(point, indent=None) for point in points))


def _csv(points: Sequence[dict[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for point in points:
        spread = point["covariance"]
        own = [spread[i][j] for i in range(3) for j in range(i, 3)]
        head = (point["time_s"], point["track"], point["status"])
        writer.writerow([*head, *point["position"], *point["velocity"], *own, " ".join(point["cameras"])])
    return text.getvalue()
