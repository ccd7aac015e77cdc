"""A whole recording of detections at once: the fold of `follow_scan`, with what is only known at its end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from aerojax.track.following import Followed, FollowingConfig, FollowingState, end_round, follow_scan
from aerojax.track.sights import UNKNOWN, Detections, TimedCamera, scans_of

NOBODY = -1
"""Owner of a detection that is of no track."""
_SLACK = 0.9
"""Share of the slowest camera's frame that a round lasts at least: stamps are not perfectly regular."""
_WINDOW = 1.2
"""Frames of the slowest camera that a sight may be old in a birth."""
_OTHER_RATE = 1.2
"""Frames of two cameras that differ by more are of other rates."""


@dataclass(frozen=True, eq=False)
class Moment:
    """All tracks at the end of one round; time_s: seconds on the network's clock."""

    time_s: float
    tracks: tuple[Followed, ...]


@dataclass(frozen=True, eq=False)
class Following:
    """What became of a recording.

    moments: in order, with the tracks that are or will be believed; each has its number from its birth on.
    owner: the number of the track that claimed each detection, `NOBODY` for none.
    state: to go on with; its last round is open, so that what follows is as if there had been no end.
    """

    moments: tuple[Moment, ...]
    owner: Int64[np.ndarray, "sight"]
    state: FollowingState

    def paths(self) -> dict[int, tuple[Float64[np.ndarray, "moment"], Float64[np.ndarray, "moment 3"]]]:
        """When and where each track was, by its number; seconds, and metres."""
        found: dict[int, list[tuple[float, Float64[np.ndarray, "3"]]]] = {}
        for moment in self.moments:
            for one in moment.tracks:
                if one.number is not None:
                    found.setdefault(one.number, []).append((moment.time_s, one.mean[:3]))
        return {
            number: (np.array([time for time, _ in points]), np.stack([place for _, place in points]))
            for number, points in found.items()
        }


def follow(
    detections: Detections,
    cameras: Sequence[TimedCamera],
    config: FollowingConfig,
    *,
    state: FollowingState | None = None,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Following:
    """Track everything in a recording.

    Where cameras differ in rate, a round lasts about one frame of the slowest.

    Args:
        detections: in any order.
        cameras: that they belong to.
        config: see there.
        state: to go on from; the beginning if None.
        progress: called every hundred images with (done, total, what).
    """
    config = suited(config, detections)
    scans = scans_of(detections, cameras, config.noise)
    state, rounds = _forgetful(state or FollowingState()), []
    told = state.time_s if state.heard else None
    for done, scan in enumerate(scans):
        at = state.time_s
        ended, state = follow_scan(scan, state, cameras, config)
        if ended is not None and at != told:  # the last round before a restart was told then
            rounds.append(Moment(at, ended))
        if done % 100 == 0:
            progress(done, len(scans), "images")
    if state.heard and state.time_s != told:
        rounds.append(Moment(state.time_s, end_round(state, cameras, config)[0]))
    progress(len(scans), len(scans), "images")
    return _named(rounds, len(detections.camera), state)


def _forgetful(state: FollowingState) -> FollowingState:
    """A state whose sights are of no row: those of the detections that come now would be taken for theirs."""
    unclaimed = {c: replace(scan, rows=np.full(len(scan.rows), UNKNOWN)) for c, scan in state.unclaimed.items()}
    tracks = tuple(replace(one, seen=dict.fromkeys(one.seen, UNKNOWN)) for one in state.tracks)
    return replace(state, tracks=tracks, unclaimed=unclaimed)


def _named(rounds: Sequence[Moment], sights: int, state: FollowingState) -> Following:
    """Tracks with the numbers that they were given later, without those that were never believed."""
    number = {one.key: one.number for moment in rounds for one in moment.tracks if one.number is not None}
    owner = np.full(sights, NOBODY)
    moments = []
    for moment in rounds:
        known = tuple(replace(one, number=number[one.key]) for one in moment.tracks if one.key in number)
        for one in known:
            owner[[row for row in one.seen.values() if row != UNKNOWN]] = number[one.key]
        moments.append(Moment(moment.time_s, tuple(one for one in known if one.status != "lost")))
    return Following(tuple(moments), owner, state)


def suited(config: FollowingConfig, detections: Detections) -> FollowingConfig:
    """With rounds in which the slowest camera is heard, and births in which its last image takes part."""
    periods = [frame_period(detections.stamp_s[detections.camera == c]) for c in np.unique(detections.camera)]
    known = [period for period in periods if period is not None]
    if not known:
        return config
    same = max(known) < _OTHER_RATE * min(known)
    round_s = config.round_s if same else max(config.round_s, _SLACK * max(known))
    return replace(config, round_s=round_s, window_s=max(config.window_s, _WINDOW * max(known)))


def frame_period(stamps: Float64[np.ndarray, "sight"]) -> float | None:
    """The usual time from one image of a camera to the next, seconds; None for fewer than three images."""
    moments = np.unique(stamps)
    return float(np.median(np.diff(moments))) if len(moments) > 2 else None
