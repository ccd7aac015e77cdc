"""How much each path jerks: what makes its sights likeliest."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy.linalg import solveh_banded
from scipy.sparse import csr_array, diags_array, kron

from aerojax.track.adjust.problem import Guess, Problem, linearise
from aerojax.track.adjust.splines import Knots

LEAST, MOST = 0.3, 1000.0
"""Jerks that are believed, m/s³: straight flight is never quite straight."""
_BAND = 12
"""Control points three pieces apart share no piece; each has three coordinates."""


def likely_jerks(problem: Problem, guess: Guess) -> tuple[float, ...]:
    """Root mean square jerks (m/s³) with which each path's sights are likelier than with the present ones.

    One round of the fixed point of MacKay (1992): σ² = |jerk|² / γ, where γ counts the pieces that the sights decide.
    Cameras are held.
    """
    now = linearise(problem, guess)
    begins, found = problem.first_controls, []
    for index, (knots, jerk) in enumerate(zip(problem.knots, problem.jerks, strict=True)):
        own = csr_array(now.by_unknown[:, begins[index] : begins[index + 1]])
        normal = csr_array(own.T @ diags_array(now.weight) @ own)
        found.append(_likelier(knots, guess.controls[index], jerk, normal))
    return tuple(found)


def _likelier(knots: Knots, controls: Float64[np.ndarray, "control 3"], jerk: float, normal: csr_array) -> float:
    rows = knots.jerk_matrix() * np.sqrt(knots.spacing_s)
    each = csr_array(kron(rows, np.eye(3))).toarray()
    width = 3 * knots.controls
    banded = np.zeros((_BAND, width))
    for down in range(_BAND):
        banded[down, : width - down] = normal.diagonal(-down)
    banded[0] += 1e-12
    unsure = float(np.sum(each.T * solveh_banded(banded, each.T, lower=True)))
    decided = max(len(each) - unsure / jerk**2, 1e-3 * len(each))
    return float(np.clip(np.sqrt(np.sum((rows @ controls) ** 2) / decided), LEAST, MOST))
