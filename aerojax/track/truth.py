"""Tracks beside a capture's truth."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from aerojax.capture.truth import Truth
from aerojax.track.offline import Following

Ids = Int64[np.ndarray, "_"]
Places = Float64[np.ndarray, "_ 3"]


def beside_truth(following: Following, truth: Truth, fps: float) -> list[tuple[Ids, Places, Ids, Places]]:
    """For every moment: ids and positions of what flew, and numbers and positions of the tracks; metres, world."""
    found = []
    for moment in following.moments:
        numbers = np.array([one.number for one in moment.tracks], np.int64)
        places = np.array([one.mean[:3] for one in moment.tracks], np.float64).reshape(-1, 3)
        found.append((*truth_at(truth, moment.time_s, fps), numbers, places))
    return found


def truth_at(
    truth: Truth, time_s: float, fps: float
) -> tuple[Int64[np.ndarray, "object"], Float64[np.ndarray, "object 3"]]:
    """Ids and positions (metres, world) of the objects at a moment, straight between two frames.

    Args:
        truth: of the capture.
        time_s: seconds since its frame 0.
        fps: of the capture.

    Returns:
        Of the objects whose frames reach so far; perhaps none.
    """
    ids, places = [], []
    for one in truth.objects:
        times = np.array([state.frame for state in one.frames], np.float64) / fps
        if len(times) and times[0] - 0.5 / fps <= time_s <= times[-1] + 0.5 / fps:
            known = np.array([state.position for state in one.frames], np.float64)
            ids.append(one.object_id)
            places.append([float(np.interp(time_s, times, axis)) for axis in known.T])
    return np.array(ids, np.int64), np.array(places, np.float64).reshape(-1, 3)
