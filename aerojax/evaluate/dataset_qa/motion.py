"""How shapes move: Chamfer distances between a sequence's frames, their spectrum and period (thesis Figure 6.7)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from aerojax.core.types import CLASSES

PUBLISHED_PERIODS = {"bird": 12.0, "drone": 8.0, "airplane": 22.0, "helicopter": 16.0}
"""Frames, as the thesis detects them on its own models (section 6.3.5)."""

_STILL = 1e-5  # metres; Chamfer distances below are rounding
_DIP = 0.3  # of the range that a lag's distance must fall below both neighbouring peaks to count as a return


def _chamfer(one: np.ndarray, tree: KDTree, other: np.ndarray, other_tree: KDTree) -> float:
    return float(0.5 * (tree.query(other)[0].mean() + other_tree.query(one)[0].mean()))


def chamfer_matrix(clouds: Float[np.ndarray, "time point 3"]) -> Float[np.ndarray, "time time"]:
    """Chamfer distance of all pairs of frames, in the unit of the points; row 0 is the distance to the first frame."""
    trees = [KDTree(cloud) for cloud in clouds]
    matrix = np.zeros((len(clouds), len(clouds)))
    for i in range(len(clouds)):
        for j in range(i + 1, len(clouds)):
            matrix[i, j] = matrix[j, i] = _chamfer(clouds[i], trees[i], clouds[j], trees[j])
    return matrix


def lag_curve(matrix: Float[np.ndarray, "time time"]) -> Float[np.ndarray, "time"]:
    """Mean distance between frames that are 0, 1, 2 … frames apart: it returns to low values after each period.

    Unlike a single row it does not depend on where in its cycle a sequence starts.
    """
    return np.array([np.diagonal(matrix, lag).mean() for lag in range(len(matrix))])


def spectrum(curve: Float[np.ndarray, "time"]) -> Float[np.ndarray, "frequency"]:
    """Magnitudes of the Fourier transform without the mean; bin k is k/time cycles a frame, up to Nyquist."""
    return np.abs(np.fft.rfft(curve - curve.mean())) / len(curve)


def detect_period(lags: Float[np.ndarray, "time"]) -> float | None:
    """Frames until a shape returns, between frames by a parabola; None where nothing moves or nothing returns.

    The first local minimum counts that lies below the peaks before and after it by 0.3 of the curve's range and is
    nearly as deep as the deepest (by the same 0.3), so that a cycle that is no whole number of frames is not taken for
    its double. Lags beyond two thirds of the sequence are averages of too few pairs. Motion faster
    than half the frame rate shows its alias, as it does in the images.
    """
    usable = lags[: max(3, 2 * len(lags) // 3 + 1)]
    reach = float(usable.max() - usable.min())
    if reach < _STILL:
        return None
    dips = [
        lag
        for lag in range(2, len(usable) - 1)
        if usable[lag] <= usable[lag - 1]
        and usable[lag] < usable[lag + 1]
        and min(usable[:lag].max(), usable[lag:].max()) - usable[lag] >= _DIP * reach
    ]
    if not dips:
        return None
    deepest = min(usable[dips])
    first = next(lag for lag in dips if usable[lag] <= deepest + _DIP * reach)
    before, here, after = usable[first - 1 : first + 2]
    bend = before - 2 * here + after
    return float(first + (0.5 * (before - after) / bend if bend > 0 else 0.0))


@dataclass(frozen=True, eq=False)
class Motion:
    """One identity's motion: distance to frame 1 and by lag (metres), and the period in frames, or None."""

    identity: str
    label: str
    to_first: Float[np.ndarray, "time"]
    by_lag: Float[np.ndarray, "time"]
    period: float | None


def motion_of(identity: str, label: str, clouds: Float[np.ndarray, "time point 3"]) -> Motion:
    """Chamfer analysis of one identity's clouds in its body frame."""
    matrix = chamfer_matrix(clouds)
    lags = lag_curve(matrix)
    return Motion(identity, label, matrix[0], lags, detect_period(lags))


@dataclass(frozen=True, eq=False)
class ClassMotion:
    """A row of Figure 6.7: mean and deviation over identities, spectrum, and median period of those that have one.

    periodic: identities with a period. peak: frames a cycle of the strongest bin of the mean spectrum, None if still.
    """

    label: str
    identities: int
    mean: Float[np.ndarray, "time"]
    deviation: Float[np.ndarray, "time"]
    spectrum: Float[np.ndarray, "frequency"]
    periodic: int
    period: float | None
    quartiles: tuple[float, float] | None
    peak: float | None
    published_period: float


def class_motions(motions: Sequence[Motion]) -> tuple[ClassMotion, ...]:
    """Rows by class in the order of `CLASSES`; of each identity the length that all have."""
    frames = min((len(motion.to_first) for motion in motions), default=0)
    rows = []
    for label in CLASSES:
        mine = [motion for motion in motions if motion.label == label]
        if mine and frames > 1:
            rows.append(_row(label, mine, frames))
    return tuple(rows)


def _row(label: str, motions: Sequence[Motion], frames: int) -> ClassMotion:
    curves = np.stack([motion.to_first[:frames] for motion in motions])
    magnitude = np.mean([spectrum(curve) for curve in curves], axis=0)
    periods = [motion.period for motion in motions if motion.period is not None]
    peak = frames / int(magnitude[1:].argmax() + 1) if magnitude.max() > _STILL / math.sqrt(frames) else None
    quartiles = tuple(float(v) for v in np.percentile(periods, (25, 75))) if periods else None
    return ClassMotion(
        label=label,
        identities=len(motions),
        mean=curves.mean(axis=0),
        deviation=curves.std(axis=0),
        spectrum=magnitude,
        periodic=len(periods),
        period=float(np.median(periods)) if periods else None,
        quartiles=(quartiles[0], quartiles[1]) if quartiles else None,
        peak=peak,
        published_period=PUBLISHED_PERIODS[label],
    )
