"""Which camera disagrees with the others over a clip, why most likely, and by how much: least squares in running sums.

Two kinds of rows are fitted, both linear in where a camera's pictures of the object are displaced to: offsets of the
central rays from the point where all meet, that point projected out, and the shifts of `Tangency`. If camera k alone
is wrong, its displacement at distance z along its image axes E is z α + E v τ: two angles α that do not change, of a
turn or a shift of the camera, and the object's velocity v times the lateness τ of its clock. For every k the normal
equations of (α, τ) are summed, three by three numbers however many frames there are; how much of the sum of squares
they explain tells the cameras apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from jaxtyping import Float64

from aerojax.reconstruct.consistency import Consistency, Sightlines

RAY_SHARE = 0.06
"""Standard deviation of a central ray's offset with perfect cameras, shares of the object's size: outlines differ."""
TANGENT_SHARE = 0.02
"""That of a shift: thin parts that masks lose."""
TANGENT_PIXELS = 0.7
"""And in pixels of either camera."""
_TURN_DEG = 3.0
"""Standard deviation of turns that the fit expects, each angle."""
_LATE_S = 0.2
"""And of clocks."""
_EXPLAINED = 0.5
"""Share of the sum of squares that one camera's fault leaves at most, for that camera to be named."""
_NEXT = 2.0
"""And how many times as much the next likely camera's leaves at least. `TrustConfig` says how often names are right."""
_CLOCK, _ALIKE = 1.4, 2.5
"""A clock is the cause where it leaves up to so many times as much as a turn, which has one parameter more; up to the
second it cannot be told. Measured as in `TrustConfig`: clocks leave 0.8 to 1.7 times as much, turns 3 to 200 times."""
_PARAMETERS = {"turn": [0, 1], "clock": [2], "both": [0, 1, 2]}

Cause = Literal["turn", "clock", "either"]
"""What a camera's disagreement looks like: a constant turn (or place), a clock, or it cannot be told."""


@dataclass(frozen=True, eq=False)
class Disagreement:
    """Sums over the frames of one object; those of two sets of frames add up with `+`.

    frames: that were added. rows, squares: of all of them, whitened.
    normal, right, moving: of each camera's (α, τ), and squares, in frames whose velocity is known: the others say
        nothing of clocks and would speak for turns.
    shift, shifts: sum of each camera's shift, metres, and how many are known.
    size: sum of the object's sizes, metres.
    distance, pixel: sums of each camera's distance, and of what its pixels are worth at the object, metres.
    seen: frames in which each camera counts.
    """

    frames: int
    rows: int
    squares: float
    normal: Float64[np.ndarray, "camera 3 3"]
    right: Float64[np.ndarray, "camera 3"]
    moving: float
    shift: Float64[np.ndarray, "camera"]
    shifts: Float64[np.ndarray, "camera"]
    size: float
    distance: Float64[np.ndarray, "camera"]
    pixel: Float64[np.ndarray, "camera"]
    seen: Float64[np.ndarray, "camera"]

    @staticmethod
    def none(cameras: int) -> Disagreement:
        """Nothing seen yet."""
        zeros = np.zeros(cameras)
        tables = np.zeros((cameras, 3, 3)), np.zeros((cameras, 3))
        return Disagreement(0, 0, 0.0, *tables, 0.0, zeros, zeros, 0.0, zeros, zeros, zeros)

    @staticmethod
    def of(one: Consistency, velocity: Float64[np.ndarray, "3"] | None) -> Disagreement:
        """The sums of one frame.

        Args:
            one: its figures.
            velocity: of the object, metres a second, rig's axes; None where it is not known.
        """
        lines, known = one.lines, np.isfinite(one.shift_m)
        design, values = _rows(one, np.zeros(3) if velocity is None else velocity)
        fitted = float(velocity is not None)
        return Disagreement(
            frames=1,
            rows=len(values),
            squares=float(values @ values),
            normal=fitted * np.einsum("rck,rcl->ckl", design, design),
            right=fitted * np.einsum("rck,r->ck", design, values),
            moving=fitted * float(values @ values),
            shift=np.where(known, one.shift_m, 0.0),
            shifts=known.astype(np.float64),
            size=lines.size,
            distance=np.where(lines.valid, lines.distance, 0.0),
            pixel=np.where(lines.valid, lines.pixel, 0.0),
            seen=lines.valid.astype(np.float64),
        )

    def __add__(self, other: Disagreement) -> Disagreement:
        """The sums over both sets of frames."""
        names = [field.name for field in fields(self)]
        return Disagreement(**{name: getattr(self, name) + getattr(other, name) for name in names})

    @property
    def level(self) -> float:
        """Root mean square of the rows: up to about 1 where outlines and pixels alone make the cameras differ."""
        return float(np.sqrt(self.squares / self.rows)) if self.rows else 0.0

    @property
    def views(self) -> float | None:
        """Cameras that count, mean over the frames; None before the first."""
        return float(self.seen.sum()) / self.frames if self.frames else None

    @property
    def mean_size(self) -> float:
        """Of the object, metres."""
        return self.size / max(self.frames, 1)

    @property
    def mean_shift(self) -> Float64[np.ndarray, "camera"]:
        """Of each camera's outlines against the others', metres; NaN where nothing is known."""
        return np.where(self.shifts > 0, self.shift / np.maximum(self.shifts, 1), np.nan)

    @property
    def mean_pixel(self) -> Float64[np.ndarray, "camera"]:
        """What a pixel is worth at the object, metres; NaN of cameras that never count."""
        return np.where(self.seen > 0, self.pixel / np.maximum(self.seen, 1), np.nan)


@dataclass(frozen=True)
class Suspect:
    """The camera whose fault alone would explain most of a disagreement.

    camera: index. cause: what it looks like.
    offset_m, offset_px: by how much its pictures are displaced, at the object and in its image.
    turn_deg: if it is turned. late_s: if its clock is wrong; positive where it shows what is later than it says.
    """

    camera: int
    cause: Cause
    offset_m: float
    offset_px: float
    turn_deg: float
    late_s: float


def suspect(sums: Disagreement) -> Suspect | None:
    """The camera that is wrong, if one explains the disagreement and no other does nearly as well; else None.

    Takes two frames: of one alone nothing is told.
    """
    cameras = np.flatnonzero(sums.seen)
    if len(cameras) < 3 or sums.moving == 0:
        return None
    left = {int(camera): _fit(sums, int(camera), "both")[0] for camera in cameras}
    first, second = sorted(left, key=lambda camera: left[camera])[:2]
    if left[first] > _EXPLAINED * sums.moving or left[second] < _NEXT * left[first]:
        return None
    (turned, turn), (delayed, late) = _fit(sums, first, "turn"), _fit(sums, first, "clock")
    cause: Cause = "clock" if delayed < _CLOCK * turned else "either" if delayed < _ALIKE * turned else "turn"
    angle = float(np.linalg.norm(turn))
    offset = angle * float(sums.distance[first] / sums.seen[first])
    return Suspect(
        first, cause, offset, offset / float(sums.mean_pixel[first]), float(np.rad2deg(angle)), float(late[0])
    )


def _fit(
    sums: Disagreement, camera: int, what: Literal["turn", "clock", "both"]
) -> tuple[float, Float64[np.ndarray, "parameter"]]:
    """Sum of squares that a camera's fault leaves, and the fault."""
    kept = _PARAMETERS[what]
    expected = np.array([np.deg2rad(_TURN_DEG)] * 2 + [_LATE_S])[kept]
    normal = sums.normal[camera][np.ix_(kept, kept)] + np.diag(expected**-2.0)
    fault = np.linalg.solve(normal, sums.right[camera][kept])
    return sums.moving - float(sums.right[camera][kept] @ fault), fault


def _rows(
    one: Consistency, velocity: Float64[np.ndarray, "3"]
) -> tuple[Float64[np.ndarray, "row camera 3"], Float64[np.ndarray, "row"]]:
    """Whitened rows: how each camera's (α, τ) changes a value, and the value."""
    moved = _displacements(one.lines, velocity)
    (rays, offsets), (pairs, shifts) = _ray_rows(one.lines, moved), _tangent_rows(one, moved)
    return np.concatenate([rays, pairs]), np.concatenate([offsets, shifts])


def _ray_rows(
    lines: Sightlines, moved: Float64[np.ndarray, "camera 3 3"]
) -> tuple[Float64[np.ndarray, "row camera 3"], Float64[np.ndarray, "row"]]:
    cameras = np.flatnonzero(lines.valid)
    if len(cameras) < 2:  # one ray meets itself
        return np.zeros((0, len(lines.valid), 3)), np.zeros(0)
    axes = lines.across[cameras].reshape(-1, 3)
    project = (np.eye(len(axes)) - axes @ np.linalg.pinv(axes)) / (RAY_SHARE * lines.size)
    design = np.zeros((len(axes), len(lines.valid), 3))
    for n, camera in enumerate(cameras):
        design[:, camera] = project[:, 2 * n : 2 * n + 2] @ lines.across[camera] @ moved[camera]
    return design, project @ lines.centre[cameras].reshape(-1)


def _tangent_rows(
    one: Consistency, moved: Float64[np.ndarray, "camera 3 3"]
) -> tuple[Float64[np.ndarray, "row camera 3"], Float64[np.ndarray, "row"]]:
    pixel, share = one.lines.pixel, TANGENT_SHARE * one.lines.size
    design = np.zeros((len(one.tangencies), len(pixel), 3))
    values = np.zeros(len(one.tangencies))
    for n, pair in enumerate(one.tangencies):
        noise = np.sqrt(share**2 + TANGENT_PIXELS**2 * (pixel[pair.first] ** 2 + pixel[pair.second] ** 2))
        design[n, pair.first] = pair.normal @ moved[pair.first] / noise
        design[n, pair.second] = -pair.normal @ moved[pair.second] / noise
        values[n] = pair.shift / noise
    return design, values


def _displacements(lines: Sightlines, velocity: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "camera 3 3"]:
    """Metres by which the object's picture moves, per radian along each image axis and per second of lateness."""
    angles = np.swapaxes(lines.across, 1, 2) * lines.distance[:, None, None]
    in_image = np.einsum("cak,cal->ckl", lines.across, lines.across)
    return np.concatenate([angles, (in_image @ velocity)[..., None]], axis=-1)


def slope(times: Sequence[float], positions: Sequence[Float64[np.ndarray, "3"]]) -> Float64[np.ndarray, "3"] | None:
    """Velocity of the straight line that fits positions best; None for fewer than two moments."""
    since = np.array(times) - np.mean(times) if times else np.zeros(0)
    if len(since) < 2 or not np.ptp(since) > 0:
        return None
    return since @ np.stack(positions) / (since @ since)
