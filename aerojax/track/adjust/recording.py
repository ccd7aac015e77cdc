"""From a recording to what is wrong with its cameras: search, track, adjust, look at silhouettes, and once more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Int64

from aerojax.core.errors import UserError
from aerojax.track.adjust.adjustment import PathModel
from aerojax.track.adjust.clock_search import search_offsets
from aerojax.track.adjust.corrections import CLOCK, SHIFT, TURN, Correction, corrected, corrections_to_json, difference
from aerojax.track.adjust.evidence import Evidence, Looked, choose
from aerojax.track.adjust.outlines import Outlines
from aerojax.track.adjust.problem import AdjustConfig, Guess, Problem, Sights, lookable, sight_distances
from aerojax.track.adjust.splines import fit, knots_over
from aerojax.track.adjust.stiffness import likely_jerks
from aerojax.track.adjust.tangency import TangentModel, Tangents, tangents
from aerojax.track.following import FollowingConfig
from aerojax.track.offline import Following, follow
from aerojax.track.sights import Detections, NoiseConfig, TimedCamera, network_times, undistorted

FEWEST_MOMENTS = 20
"""Of a track that takes part."""
FEWEST_TANGENTS = 100
"""Pairs of silhouettes that are believed more than the middles of boxes."""
BOX_S = 2.0
"""For so long the boxes of an object err alike in a camera."""
MARGIN_S = 0.1
"""By which paths are longer than what is seen, since clocks move."""
LOOSE = NoiseConfig(pixel=3.0, outline=0.1, rotation_deg=0.3, position_m=0.15)
"""For tracks of cameras that may be wrong."""
_SMOOTH = 1e-6
"""Weight of the jerk, (m/s³)², against square metres, in paths to begin with."""
_ROUNDS_OF_JERKS = 2
"""After which they change by a few hundredths."""

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, eq=False)
class Middle:
    """A camera's clock in the middle of the recording, where it is known best.

    stamp_s: the moment on its clock. late_s: what is to be added to its times there, in its middle row.
    sigma_s: standard deviation of that; 0 where clocks were not looked for.
    """

    stamp_s: float
    late_s: float
    sigma_s: float


@dataclass(frozen=True, eq=False)
class Adjustment:
    """What was found.

    corrections: one a camera; 0 where what was given explains the sights as well, with the standard deviation of what
        may yet be wrong there.
    middles: the cameras' clocks in the middle of the recording.
    before_px, after_px: by camera, the median distance of its sights from where the found paths would be seen by the
        camera as it was given, and as it was found; NaN for a camera without sights.
    sights: how many each has. tangents: pairs of silhouettes that decided the poses; 0 where boxes or points did.
    following: the tracks that all rests on.
    """

    corrections: tuple[Correction, ...]
    middles: tuple[Middle, ...]
    before_px: tuple[float, ...]
    after_px: tuple[float, ...]
    sights: tuple[int, ...]
    tangents: int
    following: Following

    def apply(self, cameras: Sequence[TimedCamera]) -> tuple[TimedCamera, ...]:
        """The cameras as they were found to be."""
        return tuple(corrected(camera, one) for camera, one in zip(cameras, self.corrections, strict=True))


def adjustment_to_json(found: Adjustment, cameras: Sequence[TimedCamera]) -> list[dict[str, Any]]:
    """JSON-ready, one a camera; None where a camera has no sights."""
    told = corrections_to_json(cameras, found.corrections)
    of_cameras = zip(told, found.before_px, found.after_px, found.sights, found.middles, strict=True)
    for one, before, after, sights, middle in of_cameras:
        one |= {"before_px": before if sights else None, "after_px": after if sights else None, "sights": sights}
        one["middle"] = asdict(middle)
    return told


@dataclass(frozen=True, eq=False)
class _Explained:
    """What was followed, what explains it, and what the evidence was for clocks, and for poses if that is another's."""

    tracked: Following
    model: PathModel
    guess: Guess
    looked: Looked
    of_clocks: Evidence
    of_poses: Evidence
    tangents: int


def adjust_recording(
    detections: Detections,
    cameras: Sequence[TimedCamera],
    following: FollowingConfig,
    config: AdjustConfig,
    *,
    outlines: Outlines | None = None,
    progress: Progress = lambda done, total, what: None,
) -> Adjustment:
    """Find what is wrong with clocks and poses.

    Args:
        detections: of the network.
        cameras: as they are given; nothing is applied to them.
        following: how objects are followed.
        config: what is looked for.
        outlines: of the detections in their order, where there are masks; poses are found much better with them.
        progress: called with (done, total, what).

    Raises:
        UserError: nothing was followed long enough.
    """
    given = tuple(cameras)
    found, kept = given, _middle_rows(detections, given, config.most_s)
    detections = detections.chosen(kept)
    outlines = None if outlines is None else tuple(outlines[row] for row in kept.tolist())
    if config.clocks and config.search_s > 0:
        offsets = search_offsets(detections, given, config.search_s)
        found = tuple(
            replace(c, time_offset_s=c.time_offset_s + o) for c, o in zip(given, offsets.tolist(), strict=True)
        )
    looked = lookable(config, len(given))
    looked[:, TURN] = looked[:, SHIFT] = False
    first = replace(following, noise=LOOSE)
    roughly = _explained(detections, outlines, found, given, looked, first, config, progress)
    last = _explained(detections, outlines, roughly.guess.cameras, given, roughly.looked, following, config, progress)
    return _told(last, detections, given)


def _told(last: _Explained, detections: Detections, given: tuple[TimedCamera, ...]) -> Adjustment:
    may, found, problem = lookable(last.model.problem.config, len(given)), last.guess.cameras, last.model.problem
    sigma = last.of_clocks.sigmas(last.looked, may)
    sigma[:, 3:] = last.of_poses.sigmas(last.looked, may)[:, 3:]
    before = sight_distances(problem, Guess(given, last.guess.controls))
    counts = np.bincount(problem.sights.camera, minlength=len(given))
    return Adjustment(
        tuple(difference(*three) for three in zip(given, found, sigma, strict=True)),
        _middles(last, detections, given, may),
        before,
        sight_distances(problem, last.guess),
        tuple(counts.tolist()),
        last.tangents,
        last.tracked,
    )


def _middles(
    last: _Explained, detections: Detections, given: tuple[TimedCamera, ...], may: Looked
) -> tuple[Middle, ...]:
    stamp_s = float((detections.stamp_s.min() + detections.stamp_s.max()) / 2)
    sigma = last.of_clocks.at(stamp_s).sigmas(last.looked, may)[:, 0].tolist()
    late = [
        after.time_offset_s - before.time_offset_s + stamp_s * (after.clock_rate - before.clock_rate)
        for before, after in zip(given, last.guess.cameras, strict=True)
    ]
    return tuple(Middle(stamp_s, *one) for one in zip(late, sigma, strict=True))


def _explained(
    detections: Detections,
    outlines: Outlines | None,
    cameras: tuple[TimedCamera, ...],
    given: tuple[TimedCamera, ...],
    looked: Looked,
    following: FollowingConfig,
    config: AdjustConfig,
    progress: Progress,
) -> _Explained:
    """Follow with these cameras, and find better ones for what was followed; again, since wrong ones miss sights."""
    may = lookable(config, len(given))
    tracked = follow(detections, cameras, following, progress=progress)
    problem, guess = _posed(detections, cameras, given, tracked, config, following.noise)
    model = PathModel(problem, progress)
    guess, _ = model.solved(looked, guess)
    for _ in range(_ROUNDS_OF_JERKS):
        model = PathModel(replace(model.problem, jerks=likely_jerks(model.problem, guess)), progress)
        guess, _ = model.solved(looked, guess)
    looked, guess = choose(model, looked, may, guess)
    evidence = model.evidence(guess)
    pairs = _tangent_pairs(detections, outlines, guess.cameras, tracked) if config.poses else None
    if pairs is None or len(pairs.first) < FEWEST_TANGENTS:
        return _Explained(tracked, model, guess, looked, evidence, evidence, 0)
    told = [(c.time_offset_s, c.clock_rate, c.line_delay_s) for c in guess.cameras]
    on_time = tuple(
        replace(c, time_offset_s=o, clock_rate=r, line_delay_s=d) for c, (o, r, d) in zip(given, told, strict=True)
    )
    poses = may.copy()
    poses[:, CLOCK] = False
    by_tangents = TangentModel(pairs, on_time, config)
    wrong, cameras = choose(by_tangents, np.zeros_like(poses), poses, on_time)
    looked = wrong | (looked & ~poses)
    held = PathModel(replace(model.problem, given=cameras), progress)
    guess, _ = held.solved(np.zeros_like(looked), replace(guess, cameras=cameras))
    return _Explained(tracked, model, guess, looked, evidence, by_tangents.evidence(cameras), len(pairs.first))


def _tangent_pairs(
    detections: Detections, outlines: Outlines | None, cameras: tuple[TimedCamera, ...], tracked: Following
) -> Tangents | None:
    if outlines is None:
        return None
    return tangents(detections.camera, network_times(detections, cameras), tracked.owner, outlines)


def _posed(
    detections: Detections,
    cameras: tuple[TimedCamera, ...],
    given: tuple[TimedCamera, ...],
    tracked: Following,
    config: AdjustConfig,
    noise: NoiseConfig,
) -> tuple[Problem, Guess]:
    """The problem of these tracks, and where to begin."""
    known = {number: path for number, path in tracked.paths().items() if len(path[0]) >= FEWEST_MOMENTS}
    if not known:
        raise UserError(
            "no-usable-frames",
            f"no object was followed for {FEWEST_MOMENTS} moments, so that clocks and poses cannot be found",
            "record an object that at least three cameras see, or raise adjust.search_s",
        )
    chosen = np.array(sorted(known))
    own = np.flatnonzero(np.isin(tracked.owner, chosen))
    part = detections.chosen(own)
    sigma = np.sqrt(noise.pixel**2 + (noise.outline * part.diagonal) ** 2)
    path = np.searchsorted(chosen, tracked.owner[own])
    sights = Sights(part.camera, part.stamp_s, part.pixels[:, 1], undistorted(part, cameras), sigma, path)
    paths = [known[number] for number in chosen.tolist()]
    knots = tuple(knots_over(times, config.knot_s, MARGIN_S) for times, _ in paths)
    controls = tuple(fit(k, *one, smooth=_SMOOTH) for k, one in zip(knots, paths, strict=True))
    jerks, outlined = (config.jerk,) * len(knots), np.mean((noise.outline * part.diagonal / sigma) ** 2)
    spread = 1 + float(outlined) * (len(own) / _views(sights) - 1)
    may = lookable(config, len(given))
    return Problem(sights, given, knots, jerks, may, config, spread), Guess(cameras, controls)


def _views(sights: Sights) -> int:
    """How many cameras' views of objects there are that differ: boxes of one err alike."""
    when = np.floor(sights.stamp_s / BOX_S).astype(np.int64)
    return len(np.unique(np.stack([sights.camera, sights.path, when], axis=1), axis=0))


def _middle_rows(detections: Detections, cameras: Sequence[TimedCamera], most_s: float) -> Int64[np.ndarray, "kept"]:
    """The detections about the middle of a long recording."""
    times = network_times(detections, cameras)
    middle = (times.min() + times.max()) / 2 if len(times) else 0.0
    return np.flatnonzero(np.abs(times - middle) <= most_s / 2)
