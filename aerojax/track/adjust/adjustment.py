"""The clocks, poses and paths that explain the sights best.

Damped Gauss-Newton steps (Levenberg 1944, Marquardt 1963) on sparse normal equations; `scipy.optimize.least_squares`
would factor dense matrices of thousands of control points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import splu

from aerojax.track.adjust.corrections import SHIFT, TURN, UNKNOWNS, Correction, corrected, difference
from aerojax.track.adjust.problem import Guess, Linearised, Problem, linearise

_FIRST_DAMPING, _LEAST_DAMPING = 1e-4, 1e-12
_MOST_TRIES = 12
_ENOUGH = 1e-7
"""Relative gain of a step that is the last one."""
_SUSPECT = 2.0
"""Corrections that are fewer times what is usual need no second look."""

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


def simplified(problem: Problem, guess: Guess, cost: float, progress: Progress) -> Guess:
    """A guess that explains the sights as well with fewer corrections, if there is one.

    What a camera's rotation does to its pixels, its position nearly can; steps end where both are corrected by part.
    So each is taken back where it is large, and what then is best is kept if it costs less.
    """
    if not problem.config.poses:
        return guess
    usual = ((TURN, np.radians(problem.config.rotation_deg)), (SHIFT, problem.config.position_m))
    for index, given in enumerate(problem.given):
        for part, scale in usual:
            values = difference(given, guess.cameras[index], np.zeros(UNKNOWNS)).values()
            if np.linalg.norm(values[part]) < _SUSPECT * scale:
                continue
            values[part] = 0
            without = corrected(given, Correction.of(values, np.zeros(UNKNOWNS)))
            cameras = (*guess.cameras[:index], without, *guess.cameras[index + 1 :])
            trial, spent = solve(problem, replace(guess, cameras=cameras), progress)
            if spent < cost:
                guess, cost = trial, spent
    return guess


def _normal(now: Linearised, free: Int64[np.ndarray, "free"]) -> tuple[csr_array, Float64[np.ndarray, "free"]]:
    """Normal matrix and right side of the weighted rows."""
    by_free = csr_array(now.by_unknown[:, free])
    turned = csr_array(by_free.T)
    return csr_array(turned @ diags_array(now.weight) @ by_free), turned @ (now.weight * now.off)


def sigmas(problem: Problem, guess: Guess) -> Float64[np.ndarray, "camera 9"]:
    """Standard deviations of the cameras' unknowns, from the inverse normal matrix; 0 for what was not looked for."""
    free = problem.free
    normal, _ = _normal(linearise(problem, guess), free)
    begin = problem.first_controls[-1]
    places = np.flatnonzero(free >= begin)
    unit = np.zeros((len(free), len(places)))
    unit[places, np.arange(len(places))] = 1.0
    found = np.zeros(problem.unknowns - begin)
    if len(places):
        solved = splu((normal + diags_array(np.full(len(free), 1e-12))).tocsc()).solve(unit)
        found[free[places] - begin] = np.sqrt(np.maximum(solved[places, np.arange(len(places))], 0))
    return found.reshape(-1, UNKNOWNS)
