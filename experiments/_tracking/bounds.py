"""How well clocks could be known at best: the Cramér-Rao bound of a simulated scene, at its truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from aerojax.track.adjust.adjustment import evidence
from aerojax.track.adjust.corrections import SHIFT, TURN
from aerojax.track.adjust.problem import AdjustConfig, Guess, Problem, Sights, lookable
from aerojax.track.adjust.splines import fit, knots_over
from aerojax.track.adjust.stiffness import likely_jerks
from aerojax.track.sights import TimedCamera, network_times
from aerojax.track.simulated import FALSE, Path, Watched

_MARGIN_S = 0.1
_PER_PIECE = 8
_SMOOTH = 1e-9


def clock_bounds(
    paths: Sequence[Path], cameras: Sequence[TimedCamera], watched: Watched, config: AdjustConfig, stamp_s: float
) -> Float64[np.ndarray, "camera"]:
    """Standard deviations of the clocks' offsets at a moment of theirs, seconds, poses and owners being known.

    From the derivatives at the true paths and cameras (van Trees 1968, with the same prior as the estimator's); jerks
    are those that are likeliest of the true paths' sights. Detections have a standard deviation of a pixel.
    """
    own = np.flatnonzero(watched.source != FALSE)
    seen, source = watched.detections.chosen(own), watched.source[own]
    times = network_times(seen, cameras)
    sights = Sights(seen.camera, seen.stamp_s, seen.pixels[:, 1], seen.pixels, np.ones(len(own)), source)
    knots = tuple(knots_over(times[source == one], config.knot_s, _MARGIN_S) for one in range(len(paths)))
    controls = []
    for one, path in zip(knots, paths, strict=True):
        dense = one.start_s + np.arange(one.pieces * _PER_PIECE) * one.spacing_s / _PER_PIECE
        controls.append(fit(one, dense, path(dense), _SMOOTH))
    looked = lookable(config, len(cameras))
    looked[:, TURN] = looked[:, SHIFT] = False
    guess = Guess(tuple(cameras), tuple(controls))
    problem = Problem(sights, tuple(cameras), knots, (config.jerk,) * len(knots), looked, config)
    jerks = likely_jerks(problem, guess)
    about = evidence(Problem(sights, tuple(cameras), knots, jerks, looked, config), guess)
    return about.at(stamp_s).sigmas(looked, looked)[:, 0]
