"""From a recording of detections to what is wrong with its cameras: search, track, adjust, and once more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aerojax.core.errors import UserError
from aerojax.track.adjust.adjustment import sigmas, simplified, solve
from aerojax.track.adjust.clock_search import search_offsets
from aerojax.track.adjust.corrections import Correction, corrected, corrections_to_json, difference
from aerojax.track.adjust.problem import AdjustConfig, Guess, Problem, Sights, sight_distances
from aerojax.track.adjust.splines import fit, knots_over
from aerojax.track.following import FollowingConfig
from aerojax.track.offline import Following, follow
from aerojax.track.sights import Detections, NoiseConfig, TimedCamera, network_times, undistorted

FEWEST_MOMENTS = 20
"""Of a track that takes part."""
MARGIN_S = 0.1
"""By which paths are longer than what is seen, since clocks move."""
LOOSE = NoiseConfig(pixel=3.0, outline=0.1, rotation_deg=0.3, position_m=0.15)
"""For tracks of cameras that may be wrong."""
_SMOOTH = 1e-6
"""Weight of the jerk, (m/s³)², against square metres, in paths to begin with."""


@dataclass(frozen=True, eq=False)
class Adjustment:
    """What was found.

    corrections: one a camera.
    before_px, after_px: by camera, the median distance of its sights from where the found paths would be seen by the
        camera as it was given, and as it was found; NaN for a camera without sights.
    sights: how many each has. following: the tracks that all rests on.
    """

    corrections: tuple[Correction, ...]
    before_px: tuple[float, ...]
    after_px: tuple[float, ...]
    sights: tuple[int, ...]
    following: Following

    def apply(self, cameras: Sequence[TimedCamera]) -> tuple[TimedCamera, ...]:
        """The cameras as they were found to be."""
        return tuple(corrected(camera, one) for camera, one in zip(cameras, self.corrections, strict=True))


def adjustment_to_json(found: Adjustment, cameras: Sequence[TimedCamera]) -> list[dict[str, Any]]:
    """JSON-ready, one a camera; None where a camera has no sights."""
    told = corrections_to_json(cameras, found.corrections)
    for one, before, after, sights in zip(told, found.before_px, found.after_px, found.sights, strict=True):
        one |= {"before_px": before if sights else None, "after_px": after if sights else None, "sights": sights}
    return told


def adjust_recording(
    detections: Detections,
    cameras: Sequence[TimedCamera],
    following: FollowingConfig,
    config: AdjustConfig,
    *,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Adjustment:
    """Find what is wrong with clocks and poses.

    Args:
        detections: of the network.
        cameras: as they are given; nothing is applied to them.
        following: how objects are followed.
        config: what is looked for.
        progress: called with (done, total, what).

    Raises:
        UserError: nothing was followed long enough.
    """
    given = tuple(cameras)
    found, detections = given, _middle(detections, given, config.most_s)
    if config.clocks and config.search_s > 0:
        offsets = search_offsets(detections, given, config.search_s)
        found = tuple(
            replace(c, time_offset_s=c.time_offset_s + o) for c, o in zip(given, offsets.tolist(), strict=True)
        )
    first = replace(following, noise=LOOSE)
    _, _, roughly = _adjusted(detections, found, given, first, config, progress)
    problem, tracked, solved = _adjusted(detections, roughly.cameras, given, following, config, progress)
    before = sight_distances(problem, Guess(given, solved.controls))
    after = sight_distances(problem, solved)
    corrections = tuple(difference(*pair) for pair in zip(given, solved.cameras, sigmas(problem, solved), strict=True))
    counts = np.bincount(problem.sights.camera, minlength=len(given))
    return Adjustment(corrections, before, after, tuple(counts.tolist()), tracked)


def _adjusted(
    detections: Detections,
    cameras: tuple[TimedCamera, ...],
    given: tuple[TimedCamera, ...],
    following: FollowingConfig,
    config: AdjustConfig,
    progress: Callable[[int, int, str], None],
) -> tuple[Problem, Following, Guess]:
    """Follow with these cameras, and find better ones for what was followed; again, since wrong ones miss sights."""
    tracked = follow(detections, cameras, following, progress=progress)
    problem, guess = _posed(detections, cameras, given, tracked, config, following.noise)
    return problem, tracked, simplified(problem, *solve(problem, guess, progress), progress)


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
    return Problem(sights, given, knots, config), Guess(cameras, controls)


def _middle(detections: Detections, cameras: Sequence[TimedCamera], most_s: float) -> Detections:
    """The detections about the middle of a long recording."""
    times = network_times(detections, cameras)
    middle = (times.min() + times.max()) / 2 if len(times) else 0.0
    return detections.chosen(np.abs(times - middle) <= most_s / 2)
