"""Several objects over time: scans of single cameras in, tracks out; births after m of n, coasting, deaths.

Every sight corrects its track by itself, at its own moment, so cameras need not be synchronised. Sights that no track
claims are looked at together once every camera has said something new (a *round*): those of different cameras whose
rays meet begin a track, which is believed after enough rounds; where a believed one is already, only if an image showed
both. All of it is a function of values and deterministic.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64
from scipy.optimize import linear_sum_assignment

from aerojax.core.config import require_at_least
from aerojax.core.errors import UserError
from aerojax.track.association import NONE, AssociationConfig, Rays, associate, concatenated
from aerojax.track.motion import MotionConfig, born, expect, predict, update
from aerojax.track.sights import NoiseConfig, Scan, TimedCamera, gate, sight_of_points

Status = Literal["tentative", "confirmed", "coasting", "lost"]

_SIZE_SHARE = 0.1
"""Of a new sight in what is known of a track's size."""


@dataclass(frozen=True)
class FollowingConfig:
    """When sights are a track.

    association, motion, noise: see there.
    confidence: share of a track's true sights that its gate lets through.
    confirm_hits, confirm_rounds: a new track is believed when so many of its last so many rounds hit it.
    birth_views: cameras that must see a new track for its round to count as a hit.
    hold_views: the same for a track that is believed; with fewer it coasts.
    coast_s: how long a track may coast before it is lost.
    round_s: how long a round lasts at least, so that slow cameras are heard in it; a little less than the slowest
        camera's frame where rates differ.
    window_s: how old a sight may be that takes part in a birth; more than one frame of the slowest camera.
    """

    association: AssociationConfig = field(default_factory=AssociationConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    confidence: float = 0.9995
    confirm_hits: int = 3
    confirm_rounds: int = 5
    birth_views: int = 3
    hold_views: int = 2
    coast_s: float = 1.0
    round_s: float = 0.0
    window_s: float = 0.05

    def __post_init__(self) -> None:
        require_at_least(self, "confirm_hits", "birth_views", "hold_views")
        require_at_least(self, "confirm_rounds", least=self.confirm_hits)
        if not 0 < self.confidence < 1:
            raise UserError("out-of-range", f"confidence is {self.confidence}", "give a share between 0 and 1")


@dataclass(frozen=True, eq=False)
class Followed:
    """One track.

    key: of its birth, never used again. number: of the object, given when it is first believed; None before.
    mean, covariance: of `aerojax.track.motion`'s state at the state's moment.
    size_m: its extent as cameras see it, the diagonal of a box at its distance; 0 where sights are points.
    status: whether it is believed and was hit in the last round.
    hits: of its last rounds. hit_s: moment of the last one. seen: row of the sight by camera, in this round.
    beside: keys of the tracks that an image showed beside it before it was believed.
    """

    key: int
    number: int | None
    mean: Float64[np.ndarray, "12"]
    covariance: Float64[np.ndarray, "12 12"]
    size_m: float
    status: Status
    hits: tuple[bool, ...]
    hit_s: float
    seen: Mapping[int, int]
    beside: frozenset[int] = frozenset()


@dataclass(frozen=True, eq=False)
class FollowingState:
    """What is remembered from scan to scan; its size does not grow with their number.

    time_s: of the last scan. began_s: of this round's first one. heard: cameras of this round.
    unclaimed: the last scan of each camera, less the sights that a track claims. keys, numbers: given so far.
    """

    time_s: float = -np.inf
    began_s: float = -np.inf
    tracks: tuple[Followed, ...] = ()
    heard: frozenset[int] = frozenset()
    unclaimed: Mapping[int, Scan] = field(default_factory=dict)
    keys: int = 0
    numbers: int = 0


def follow_scan(
    scan: Scan, state: FollowingState, cameras: Sequence[TimedCamera], config: FollowingConfig
) -> tuple[tuple[Followed, ...] | None, FollowingState]:
    """Take one image's sights.

    Args:
        scan: not earlier than the state's moment.
        state: from `FollowingState()` or the last step.
        cameras: of the network.
        config: see there.

    Returns:
        The tracks at the end of the round that this scan ends by beginning another one, lost ones for the last time;
        None where the round goes on. And the next state.

    Raises:
        ValueError: the scan is earlier than the last one.
    """
    if scan.time_s < state.time_s:
        raise ValueError(f"a scan of {scan.time_s} s after one of {state.time_s} s")
    ended = None
    lasted = scan.time_s - state.began_s
    again = scan.camera in state.heard and lasted >= config.round_s
    if again or (state.heard and lasted > config.window_s):
        ended, state = end_round(state, cameras, config)
    # Where nobody has said anything for long, no round has ended to say so.
    tracks = tuple(one for one in state.tracks if one.seen or scan.time_s - one.hit_s <= config.coast_s)
    if tracks and scan.time_s > state.time_s:
        shaken = config.noise.shape * np.array([one.size_m for one in tracks])
        moved = predict(*_stacked(tracks), scan.time_s - state.time_s, config.motion, shaken)
        tracks = _unstacked(tracks, *moved)
    tracks, free = _claimed(tracks, scan, cameras[scan.camera], config)
    unclaimed = {**state.unclaimed, scan.camera: scan.chosen(free)}
    heard = state.heard | {scan.camera}
    began_s = state.began_s if state.heard else scan.time_s
    return ended, FollowingState(scan.time_s, began_s, tracks, heard, unclaimed, state.keys, state.numbers)


def end_round(
    state: FollowingState, cameras: Sequence[TimedCamera], config: FollowingConfig
) -> tuple[tuple[Followed, ...], FollowingState]:
    """Count hits, let tracks be born, believed and lost; and begin the next round.

    Returns:
        The tracks of the round with what saw them, lost ones for the last time; and the next state.
    """
    begun, unclaimed = _born(state, cameras, config)
    every = [_noted(one, (*state.tracks, *begun)) for one in (*state.tracks, *begun)]
    judged = _joined([_judged(one, state.time_s, config) for one in every[: len(state.tracks)]])
    numbers = state.numbers
    for place, one in enumerate(judged):
        if one.number is None and one.status == "confirmed":
            judged[place], numbers = replace(one, number=numbers), numbers + 1
    every[: len(judged)] = judged
    kept = tuple(replace(one, seen={}) for one in every if one.status != "lost")
    keys = state.keys + len(begun)
    fresh = FollowingState(state.time_s, state.time_s, kept, frozenset(), unclaimed, keys, numbers)
    return tuple(every), fresh


def _noted(one: Followed, every: Iterable[Followed]) -> Followed:
    """With the others that an image of this round shows beside it, as long as it is not believed."""
    if one.number is not None:
        return one
    beside = {other.key for other in every if other.key != one.key and other.seen.keys() & one.seen.keys()}
    return replace(one, beside=one.beside | beside)


def _joined(tracks: list[Followed]) -> list[Followed]:
    """One that is to be believed now is the older one that is there already, unless an image showed both.

    An object has one silhouette in an image. Where an outline leaves its track's gate, it begins another track, and
    both would go on in turns; two objects are seen side by side by some camera.
    """
    joined = list(tracks)
    for place, one in enumerate(joined):
        if one.number is not None or one.status != "confirmed":
            continue
        for older, other in enumerate(joined[:place]):
            if other.status in ("confirmed", "coasting") and other.key not in one.beside and _together(one, other):
                joined[older] = _taken_over(other, one)
                joined[place] = replace(one, status="lost", seen={})
                break
    return joined


def _together(one: Followed, other: Followed) -> bool:
    return float(np.linalg.norm(one.mean[:3] - other.mean[:3])) < (one.size_m + other.size_m) / 2


def _taken_over(older: Followed, newer: Followed) -> Followed:
    """The older track with all that both were seen by, and the state of the one that more cameras saw."""
    better = newer if len(newer.seen) > len(older.seen) else older
    return replace(
        older,
        mean=better.mean,
        covariance=better.covariance,
        size_m=better.size_m,
        status="confirmed",
        hits=(*older.hits[:-1], True),
        hit_s=newer.hit_s,
        seen={**newer.seen, **older.seen},
    )


def _judged(one: Followed, time_s: float, config: FollowingConfig) -> Followed:
    """A track after its round."""
    hit = len(one.seen) >= (config.birth_views if one.number is None else config.hold_views)
    hits = (*one.hits, hit)[-config.confirm_rounds :]
    hit_s = time_s if hit else one.hit_s
    status: Status
    if one.number is not None:
        status = "confirmed" if hit else "coasting"
        if time_s - hit_s > config.coast_s:
            status = "lost"
    elif sum(hits) >= config.confirm_hits:
        status = "confirmed"
    else:
        # Lost as soon as the rounds that are left cannot confirm it.
        misses = len(hits) - sum(hits)
        status = "lost" if misses > config.confirm_rounds - config.confirm_hits else "tentative"
    return replace(one, status=status, hits=hits, hit_s=hit_s)


def _claimed(
    tracks: tuple[Followed, ...], scan: Scan, camera: TimedCamera, config: FollowingConfig
) -> tuple[tuple[Followed, ...], np.ndarray]:
    """Tracks corrected by the sights that they claim, and which sights are left; believed tracks choose first."""
    free = np.ones(len(scan.times), bool)
    corrected = list(tracks)
    for believed in (True, False):
        group = [i for i, one in enumerate(tracks) if (one.number is not None) == believed]
        rows = np.flatnonzero(free)
        if not group or len(rows) == 0:
            continue
        means, covariances = _stacked([tracks[i] for i in group])
        expected = expect(means, covariances, scan.chosen(rows), camera, config.noise)
        own, sights = _assigned(expected.distance, expected.log_spread, config.confidence)
        if len(own) == 0:
            continue
        moved, spread = update(means, covariances, expected, own, sights)
        sizes = _sizes(scan.diagonal[rows[sights]], moved[:, :3], camera)
        for number, (place, sight) in enumerate(zip(own, sights, strict=True)):
            before = tracks[group[place]]
            corrected[group[place]] = replace(
                before,
                mean=moved[number],
                covariance=spread[number],
                size_m=before.size_m + _SIZE_SHARE * (float(sizes[number]) - before.size_m),
                seen={**before.seen, scan.camera: int(scan.rows[rows[sight]])},
            )
        free[rows[sights]] = False
    return tuple(corrected), free


def _sizes(
    diagonal: Float64[np.ndarray, "sight"], points: Float64[np.ndarray, "sight 3"], camera: TimedCamera
) -> Float64[np.ndarray, "sight"]:
    """How long diagonals (pixels) of boxes about points (metres, world) are there, metres."""
    return diagonal * sight_of_points(points, camera)[2] / camera.K[0, 0]


def _assigned(
    distance: Float64[np.ndarray, "track sight"], log_spread: Float64[np.ndarray, "track sight"], confidence: float
) -> tuple[Int64[np.ndarray, "pair"], Int64[np.ndarray, "pair"]]:
    """Pairs of track and sight of the greatest likelihood in total, within the gate (Hungarian algorithm).

    The cost is -2 log of the normal density, so a track that is known well is preferred to one that could be anywhere;
    to miss a track costs as much as the worst sight in its gate.
    """
    limit = gate(confidence, 2)
    inside = distance < limit
    miss = limit + float(log_spread[inside].max(initial=-np.inf)) if inside.any() else 0.0
    tracks, sights = linear_sum_assignment(np.where(inside, np.where(inside, distance, 0.0) + log_spread, miss))
    kept = inside[tracks, sights]
    return tracks[kept], sights[kept]


def _born(
    state: FollowingState, cameras: Sequence[TimedCamera], config: FollowingConfig
) -> tuple[list[Followed], dict[int, Scan]]:
    """New tracks of what no track claims, and what remains of that."""
    recent = {c: s for c, s in state.unclaimed.items() if s.time_s >= state.time_s - config.window_s and len(s.times)}
    if len(recent) < config.association.min_views:
        return [], recent
    scans = [recent[camera] for camera in sorted(recent)]
    rays = concatenated(
        [Rays(np.full(len(s.times), s.camera), s.times - state.time_s, s.pixels, s.variance) for s in scans]
    )
    rows, diagonal = (np.concatenate([getattr(s, name) for s in scans]) for name in ("rows", "diagonal"))
    found = associate(rays, cameras, config.association, config.noise)
    order = np.lexsort(found.sights.T)  # keys do not depend on how the solver lists its solution
    begun, used = [], np.zeros(len(rows), bool)
    for key, index in enumerate(order):
        sights = {c: int(row) for c, row in enumerate(found.sights[index]) if row != NONE}
        used[list(sights.values())] = True
        point = found.state[index, :3]
        sizes = [_sizes(diagonal[[row]], point[None], cameras[c])[0] for c, row in sights.items()]
        size = float(np.mean(sizes))
        mean, covariance = born(found.state[index], found.covariance[index], config.motion, config.noise.shape * size)
        seen = {c: int(rows[row]) for c, row in sights.items()}
        begun.append(Followed(state.keys + key, None, mean, covariance, size, "tentative", (True,), state.time_s, seen))
    ends = np.cumsum([len(s.times) for s in scans])[:-1]
    left = {s.camera: s.chosen(~own) for s, own in zip(scans, np.split(used, ends), strict=True)}
    return begun, left


def _stacked(tracks: Sequence[Followed]) -> tuple[Float64[np.ndarray, "track 12"], Float64[np.ndarray, "track 12 12"]]:
    return np.stack([one.mean for one in tracks]), np.stack([one.covariance for one in tracks])


def _unstacked(
    tracks: Iterable[Followed], means: Float64[np.ndarray, "track 12"], covariances: Float64[np.ndarray, "track 12 12"]
) -> tuple[Followed, ...]:
    return tuple(
        replace(one, mean=mean, covariance=covariance)
        for one, mean, covariance in zip(tracks, means, covariances, strict=True)
    )
