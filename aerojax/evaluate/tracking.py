"""How good tracks in space are: IDF1, GOSPA, ghosts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.optimize import linear_sum_assignment


@dataclass(frozen=True, eq=False)
class TrackingFrame:
    """One moment: who is where in truth, and who was said to be where; metres, any one frame of reference."""

    truth_ids: Int64[np.ndarray, "object"]
    truth: Float64[np.ndarray, "object 3"]
    ids: Int64[np.ndarray, "track"]
    positions: Float64[np.ndarray, "track 3"]

    def distances(self) -> Float64[np.ndarray, "object track"]:
        """From every object to every track."""
        return np.linalg.norm(self.truth[:, None] - self.positions[None], axis=-1)


@dataclass(frozen=True)
class Gospa:
    """The metric and its parts, each such that distance^p is their sum.

    distance: metres. localisation: Σ dᵖ of the objects that are found. missed, false: cᵖ/2 for each.
    """

    distance: float
    localisation: float
    missed: float
    false: float


@dataclass(frozen=True)
class TrackingFigures:
    """Of a recording.

    idf1, id_precision, id_recall: of identities, 0..1. switches: how often an object's track changes its number.
    gospa: mean over the moments, metres. rmse: of what is found, metres; NaN where nothing is.
    ghosts: tracks that are no object, in a hundred moments. missed: share of the objects' moments without a track.
    """

    idf1: float
    id_precision: float
    id_recall: float
    switches: int
    gospa: float
    rmse: float
    ghosts: float
    missed: float


def gospa(frame: TrackingFrame, *, cutoff: float = 5.0, order: float = 2.0) -> Gospa:
    """Generalised optimal sub-pattern assignment metric with α = 2 (Rahmathullah, García-Fernández & Svensson 2017).

    d = (min Σ d(x, y)ᵖ over assigned pairs nearer than c + cᵖ/2 · (missed + false))^(1/p).

    Args:
        frame: one moment.
        cutoff: c, metres. order: p.
    """
    distance = frame.distances()
    pairs = _pairs(distance, cutoff, order)
    localisation = float(np.sum(distance[pairs] ** order))
    missed = (len(frame.truth_ids) - len(pairs[0])) * cutoff**order / 2
    false = (len(frame.ids) - len(pairs[0])) * cutoff**order / 2
    return Gospa((localisation + missed + false) ** (1 / order), localisation, missed, false)


def _pairs(
    distance: Float64[np.ndarray, "object track"], cutoff: float, order: float
) -> tuple[Int64[np.ndarray, "pair"], Int64[np.ndarray, "pair"]]:
    """Objects and tracks of the least Σ min(d, c)ᵖ, without those that are c apart."""
    objects, tracks = linear_sum_assignment(np.minimum(distance, cutoff) ** order)
    near = distance[objects, tracks] < cutoff
    return objects[near], tracks[near]


def tracking_figures(frames: Sequence[TrackingFrame], *, reach: float = 1.0, cutoff: float = 5.0) -> TrackingFigures:
    """Figures of a recording.

    IDF1 = 2·IDTP / (objects' moments + tracks' moments), IDTP the moments in which paired identities are within reach,
    of the pairing of whole trajectories that makes it largest (Ristani et al. 2016, in space instead of boxes).

    Args:
        frames: in order.
        reach: how near a track is to an object that it is of, metres.
        cutoff: of GOSPA, metres.
    """
    objects = sorted({int(i) for frame in frames for i in frame.truth_ids})
    tracks = sorted({int(i) for frame in frames for i in frame.ids})
    together = np.zeros((len(objects), len(tracks)), np.int64)
    for frame in frames:
        near = np.argwhere(frame.distances() < reach)
        for row, column in near:
            together[objects.index(frame.truth_ids[row]), tracks.index(frame.ids[column])] += 1
    paired = linear_sum_assignment(-together)
    right = int(together[paired].sum())
    there = sum(len(frame.truth_ids) for frame in frames)
    said = sum(len(frame.ids) for frame in frames)
    found, squares, switches = _matched(frames, reach)
    return TrackingFigures(
        idf1=_share(2 * right, there + said),
        id_precision=_share(right, said),
        id_recall=_share(right, there),
        switches=switches,
        gospa=float(np.mean([gospa(frame, cutoff=cutoff).distance for frame in frames])) if frames else 0.0,
        rmse=float(np.sqrt(squares / found)) if found else float("nan"),
        ghosts=100 * (said - found) / len(frames) if frames else 0.0,
        missed=_share(there - found, there),
    )


def owners(frames: Sequence[TrackingFrame], *, reach: float = 1.0) -> dict[int, int]:
    """The object that each track is of: the one that it was paired with most often; tracks of none are left out.

    Args:
        frames: in order.
        reach: how near a track is to an object that it is of, metres.
    """
    counts: dict[int, Counter[int]] = {}
    for frame in frames:
        for row, column in zip(*_pairs(frame.distances(), reach, 2.0), strict=True):
            counts.setdefault(int(frame.ids[column]), Counter())[int(frame.truth_ids[row])] += 1
    return {track: count.most_common(1)[0][0] for track, count in sorted(counts.items())}


def _matched(frames: Sequence[TrackingFrame], reach: float) -> tuple[int, float, int]:
    """Pairs of object and track within reach, Σ of their squared distances, and changes of an object's track."""
    found, squares, switches = 0, 0.0, 0
    last: dict[int, int] = {}
    for frame in frames:
        distance = frame.distances()
        for row, column in zip(*_pairs(distance, reach, 2.0), strict=True):
            found += 1
            squares += float(distance[row, column] ** 2)
            thing, track = int(frame.truth_ids[row]), int(frame.ids[column])
            switches += last.get(thing, track) != track
            last[thing] = track
    return found, squares, switches


def _share(part: int, whole: int) -> float:
    return part / whole if whole else 1.0
