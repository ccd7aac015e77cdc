"""The clocks, poses and paths that explain the sights best.

Damped Gauss-Newton steps (Levenberg 1944, Marquardt 1963) on sparse normal equations; `scipy.optimize.least_squares`
would factor dense matrices of thousands of control points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import splu

from aerojax.track.adjust.corrections import UNKNOWNS, Correction, corrected, difference
from aerojax.track.adjust.evidence import Evidence, Looked
from aerojax.track.adjust.problem import Guess, Linearised, Problem, linearise

_FIRST_DAMPING, _LEAST_DAMPING = 1e-4, 1e-12
_MOST_TRIES = 12
_ENOUGH = 1e-7
"""Relative gain of a step that is the last one."""
_NONE = np.zeros(UNKNOWNS)

Progress = Callable[[int, int, str], None]


def solve(problem: Problem, guess: Guess, progress: Progress) -> tuple[Guess, float]:
    """The best guess near this one, and its cost."""
    free, damping = problem.free, _FIRST_DAMPING
    now = linearise(problem, guess)
    for done in range(problem.config.steps):
        normal, right = _normal(now, free)
        for _ in range(_MOST_TRIES):
            damped = normal + diags_array(damping * normal.diagonal() + 1e-12)
            step = np.zeros(problem.unknowns)
            step[free] = -splu(damped.tocsc()).solve(right)
            trial = guess.moved(problem, step)
            then = linearise(problem, trial)
            if then.cost < now.cost:
                break
            damping *= 10
        else:
            break
        gained, guess, now = now.cost - then.cost, trial, then
        damping = max(damping / 10, _LEAST_DAMPING)
        progress(done + 1, problem.config.steps, "adjustment")
        if gained < _ENOUGH * (1 + now.cost):
            break
    return guess, now.cost


def _normal(now: Linearised, free: Int64[np.ndarray, "free"]) -> tuple[csr_array, Float64[np.ndarray, "free"]]:
    """Normal matrix and right side of the weighted rows."""
    by_free = csr_array(now.by_unknown[:, free])
    turned = csr_array(by_free.T)
    return csr_array(turned @ diags_array(now.weight) @ by_free), turned @ (now.weight * now.off)


def evidence(problem: Problem, guess: Guess) -> Evidence:
    """What the sights say of the cameras' unknowns; the paths follow."""
    now, begin = linearise(problem, guess), problem.first_controls[-1]
    normal, slope = _normal(now, np.arange(problem.unknowns))
    of_paths = splu((normal[:begin, :begin] + diags_array(np.full(begin, 1e-12))).tocsc())
    shared, own = csr_array(normal[:begin, begin:]).toarray(), slope[begin:]
    curvature = csr_array(normal[begin:, begin:]).toarray() - shared.T @ of_paths.solve(shared)
    own = own - shared.T @ of_paths.solve(slope[:begin])
    count = len(problem.sights.camera)
    return Evidence(curvature, own, float(np.log(max(count, 2))), problem.spread * _spread(now, count))


def _spread(now: Linearised, sights: int) -> float:
    """By how much the sights' variances are larger than was thought; at least 1.

    Of numbers of variance 1 along two axes, half the squares are below 2·ln 2.
    """
    squares = np.sum(now.off[: 2 * sights].reshape(-1, 2) ** 2, axis=1)
    return max(1.0, float(np.median(squares)) / (2 * np.log(2)))


@dataclass(frozen=True, eq=False)
class PathModel:
    """Paths and cameras that are to explain a problem's sights; see `choose`."""

    problem: Problem
    progress: Progress

    def solved(self, looked: Looked, guess: Guess) -> tuple[Guess, float]:
        """The best guess near this one, and its cost."""
        cameras = tuple(
            corrected(given, Correction.of(np.where(own, difference(given, camera, _NONE).values(), 0.0), _NONE))
            for given, camera, own in zip(self.problem.given, guess.cameras, looked, strict=True)
        )
        return solve(replace(self.problem, looked=looked), replace(guess, cameras=cameras), self.progress)

    def evidence(self, guess: Guess) -> Evidence:
        """About a guess."""
        return evidence(self.problem, guess)

    def values(self, guess: Guess) -> Float64[np.ndarray, "camera 9"]:
        """The cameras' corrections."""
        return np.stack(
            [difference(*pair, _NONE).values() for pair in zip(self.problem.given, guess.cameras, strict=True)]
        )
