"""Paths as uniform cubic B-splines: positions that are linear in control points, with smooth velocities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_array, eye_array
from scipy.sparse.linalg import splu


@dataclass(frozen=True)
class Knots:
    """Evenly spaced knots of one path; start_s: of the first, seconds. spacing_s: between them. pieces: of the path."""

    start_s: float
    spacing_s: float
    pieces: int

    @property
    def controls(self) -> int:
        """Control points."""
        return self.pieces + 3

    def weights(
        self, times: Float64[np.ndarray, "sight"]
    ) -> tuple[Int64[np.ndarray, "sight"], Float64[np.ndarray, "sight 4"], Float64[np.ndarray, "sight 4"]]:
        """The first of the four control points that count at each moment, and their weights in position and velocity.

        Uniform cubic B-splines (de Boor 1978, ch. IX); beyond the ends the last polynomials go on.
        """
        place = (times - self.start_s) / self.spacing_s
        piece = np.clip(np.floor(place).astype(np.int64), 0, self.pieces - 1)
        u = place - piece
        position = np.stack([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3], axis=1)
        slope = np.stack([-3 * (1 - u) ** 2, 9 * u**2 - 12 * u, -9 * u**2 + 6 * u + 3, 3 * u**2], axis=1)
        return piece, position / 6, slope / (6 * self.spacing_s)

    def jerk_matrix(self) -> csr_array:
        """The constant third derivative of each piece from the control points."""
        columns = np.arange(self.pieces)[:, None] + np.arange(4)
        values = np.broadcast_to(np.array([-1.0, 3.0, -3.0, 1.0]) / self.spacing_s**3, columns.shape)
        return _banded(values, columns, self.controls)


def _banded(values: Float64[np.ndarray, "row 4"], columns: Int64[np.ndarray, "row 4"], width: int) -> csr_array:
    rows = np.broadcast_to(np.arange(len(values))[:, None], columns.shape)
    return csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(len(values), width))


def knots_over(times: Float64[np.ndarray, "sight"], spacing_s: float, margin_s: float) -> Knots:
    """Knots of a path that is seen at these moments, which may yet move by the margin."""
    start, end = float(times.min()) - margin_s, float(times.max()) + margin_s
    return Knots(start, spacing_s, max(1, int(np.ceil((end - start) / spacing_s))))


def fit(
    knots: Knots, times: Float64[np.ndarray, "moment"], positions: Float64[np.ndarray, "moment 3"], smooth: float
) -> Float64[np.ndarray, "control 3"]:
    """Control points of the path nearest to positions, in the sense of least squares with a penalty on the jerk.

    Args:
        knots: of it.
        times, positions: any number of them; metres.
        smooth: the penalty's weight; small, it decides only where there are no positions.
    """
    first, weights, _ = knots.weights(times)
    rows = _banded(weights, first[:, None] + np.arange(4), knots.controls)
    stiff = knots.jerk_matrix()
    normal = rows.T @ rows + smooth * (stiff.T @ stiff) + 1e-12 * eye_array(knots.controls)
    return splu(normal.tocsc()).solve(rows.T @ positions)
