"""Poses from silhouettes: planes through two cameras that touch an object touch its silhouettes in both.

Whatever its shape, an object touches the outermost planes through the line between two cameras at points that both see
on their outlines (frontier points; Cipolla, Åström & Giblin 1995). So the angles about that line between which a
silhouette lies are equal for both, which middles of boxes are not: those differ by part of the object's size. Two
numbers a pair of cameras, object and instant, without any unknown but the poses (Sinha & Pollefeys 2010).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from aerojax.track.adjust.corrections import SHIFT, TURN, UNKNOWNS, Correction, corrected, difference
from aerojax.track.adjust.evidence import Evidence, Looked
from aerojax.track.adjust.outlines import Outlines
from aerojax.track.adjust.problem import AdjustConfig, crossing, prior_matrix
from aerojax.track.sights import TimedCamera

EDGE_PX = 0.5
"""Standard deviation of an outline's place."""
SAME_S = 5e-4
"""Between two images of one instant; what flies at 20 m/s moves by a centimetre."""
OUTLIER = 0.5
"""Scale of Cauchy's cost, in standard deviations. Outlines are mostly right to `EDGE_PX` and now and then off by much
more (thin parts that a camera misses), for a second or longer: with 3, six seconds of outlines erred twice as far."""
BIAS = 0.1
"""What is wrong with outlines of one object in two cameras for long (thin parts that one of them misses), in standard
deviations; pairs of one block share it, so that their mean is no better known than this."""
SIDE_S = 6.0
"""For so long an object shows about the same side. With 2 s, what was wrong with outlines of hovering drones for all of
six seconds looked like a second camera that is turned."""
_STEPS, _ENOUGH = 30, 1e-6
_NONE = np.zeros(UNKNOWNS)

Cameras = tuple[TimedCamera, ...]


@dataclass(frozen=True, eq=False)
class Tangents:
    """Pairs of silhouettes of one object in one instant.

    first, second: cameras of each pair. of_first, of_second: their silhouettes, by row of `corners`.
    blocks: how many differ in cameras, object or `SIDE_S`.
    corners: of each hull, pixels, the last one repeated to equal numbers.
    """

    first: Int64[np.ndarray, "pair"]
    second: Int64[np.ndarray, "pair"]
    of_first: Int64[np.ndarray, "pair"]
    of_second: Int64[np.ndarray, "pair"]
    blocks: int
    corners: Float64[np.ndarray, "sight corner 2"]


def tangents(
    camera: Int64[np.ndarray, "sight"],
    time_s: Float64[np.ndarray, "sight"],
    owner: Int64[np.ndarray, "sight"],
    outlines: Outlines,
) -> Tangents:
    """All pairs of silhouettes that show one object at one time.

    Args:
        camera, time_s, owner: of each detection: index, network's clock, and the track that it is of.
        outlines: of each; those without corners are left out.
    """
    known = [row for row in range(len(camera)) if len(outlines[row]) > 2 and owner[row] >= 0]
    together: dict[tuple[int, int], list[int]] = {}
    for place, row in enumerate(known):
        together.setdefault((int(owner[row]), round(time_s[row] / (2 * SAME_S))), []).append(place)
    pairs = [
        (i, j) if camera[known[i]] < camera[known[j]] else (j, i)
        for places in together.values()
        for i, j in itertools.combinations(places, 2)
        if camera[known[i]] != camera[known[j]]
    ]
    of_first, of_second = np.array(pairs, np.int64).reshape(-1, 2).T
    rows = np.array(known, np.int64)
    most = max((len(outlines[row]) for row in known), default=1)
    corners = [np.concatenate([outlines[r], np.repeat(outlines[r][-1:], most - len(outlines[r]), 0)]) for r in known]
    keys = np.stack([camera[rows[of_first]], camera[rows[of_second]], owner[rows[of_first]]], axis=1)
    when = np.floor(time_s[rows[of_first]] / SIDE_S).astype(np.int64)
    blocks = len(np.unique(np.concatenate([keys, when[:, None]], axis=1), axis=0))
    stacked = np.stack(corners) if corners else np.zeros((0, 1, 2))
    return Tangents(keys[:, 0], keys[:, 1], of_first, of_second, blocks, stacked)


@dataclass(frozen=True, eq=False)
class TangentModel:
    """Poses that are to explain tangent planes; see `choose`."""

    tangents: Tangents
    given: Cameras
    config: AdjustConfig

    def solved(self, looked: Looked, guess: Cameras) -> tuple[Cameras, float]:
        """Damped Gauss-Newton steps of what is looked for."""
        values = np.where(looked, self.values(guess), 0.0)
        damping, places = 1e-4, np.flatnonzero(looked)
        guess = self._at(values)
        normal, slope, cost = self._normal(guess)
        for _ in range(_STEPS if len(places) else 0):
            own = normal[np.ix_(places, places)]
            step = np.zeros(values.size)
            step[places] = -np.linalg.solve(own + damping * np.diag(np.diag(own)), slope[places])
            trial = tuple(
                corrected(one, Correction.of(s, _NONE))
                for one, s in zip(guess, step.reshape(values.shape), strict=True)
            )
            then = self._normal(trial)
            if then[2] >= cost:
                damping *= 10
                continue
            gained, guess, damping = cost - then[2], trial, damping / 10
            normal, slope, cost = then
            if gained < _ENOUGH * (1 + cost):
                break
        return guess, cost

    def evidence(self, guess: Cameras) -> Evidence:
        """About a guess."""
        normal, slope, _ = self._normal(guess)
        pairs = len(self.tangents.first)
        spread = 1 + BIAS**2 * pairs / max(self.tangents.blocks, 1)
        return Evidence(normal, slope, float(np.log(max(pairs, 2))), spread)

    def values(self, guess: Cameras) -> Float64[np.ndarray, "camera 9"]:
        """The cameras' corrections."""
        return np.stack([difference(*pair, _NONE).values() for pair in zip(self.given, guess, strict=True)])

    def _at(self, values: Float64[np.ndarray, "camera 9"]) -> Cameras:
        return tuple(corrected(one, Correction.of(v, _NONE)) for one, v in zip(self.given, values, strict=True))

    def _normal(self, guess: Cameras) -> tuple[np.ndarray, np.ndarray, float]:
        """Curvature, slope and cost about a guess."""
        off, by_pose = residuals(self.tangents, guess)
        scale = OUTLIER**2
        weight = 1 / (1 + off**2 / scale)
        rows = prior_matrix(self.config, self.given)
        before = rows @ self.values(guess).ravel()
        normal = np.einsum("pk,pku,pkv->uv", weight, by_pose, by_pose, optimize=True) + rows.T @ rows
        slope = np.einsum("pk,pku->u", weight * off, by_pose) + rows.T @ before
        cost = float(scale * np.sum(np.log1p(off**2 / scale)) + np.sum(before**2))
        return normal, slope, cost


def residuals(
    pairs: Tangents, cameras: Sequence[TimedCamera]
) -> tuple[Float64[np.ndarray, "pair 2"], Float64[np.ndarray, "pair 2 unknown"]]:
    """Angles between the outermost planes of both silhouettes, in standard deviations, and their derivatives."""
    count = len(pairs.first)
    off, by_pose = np.zeros((count, 2)), np.zeros((count, 2, len(cameras), UNKNOWNS))
    for i, j in sorted(set(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True))):
        rows = np.flatnonzero((pairs.first == i) & (pairs.second == j))
        both = cameras[i], cameras[j]
        inside = [
            _inside(pairs.corners[of[rows]], c) for of, c in zip((pairs.of_first, pairs.of_second), both, strict=True)
        ]
        angles = _angles([d @ c.world_from_cam[:3, :3].T for d, c in zip(inside, both, strict=True)], _base(*both))
        for side, extreme in enumerate((np.argmin, np.argmax)):
            touching = [d[np.arange(len(rows)), extreme(a, axis=1)] for d, a in zip(inside, angles, strict=True)]
            off[rows, side], by_first, by_second = _coplanar(touching, both)
            by_pose[rows, side, i], by_pose[rows, side, j] = by_first, by_second
    return off, by_pose.reshape(count, 2, -1)


def _coplanar(
    inside: Sequence[Float64[np.ndarray, "pair 3"]], both: Sequence[TimedCamera]
) -> tuple[Float64[np.ndarray, "pair"], Float64[np.ndarray, "pair 9"], Float64[np.ndarray, "pair 9"]]:
    """How far two rays are from one plane with the line between their cameras b: b·(d×e), in standard deviations.

    Its derivatives by both cameras' unknowns; those of the standard deviation are left out.
    """
    base = _base(*both)
    along = base / np.linalg.norm(base)
    d, e = (ray @ camera.world_from_cam[:3, :3].T for ray, camera in zip(inside, both, strict=True))
    wide, high = (np.linalg.norm(ray - (ray @ along)[:, None] * along, axis=1) for ray in (d, e))
    noise = EDGE_PX * np.hypot(1 / (both[0].K[1, 1] * wide), 1 / (both[1].K[1, 1] * high))
    scale = 1 / (np.linalg.norm(base) * wide * high * noise)
    normal = np.cross(d, e)
    derivatives = []
    for turned, lever, camera, sign in (
        (inside[0], np.cross(e, base), both[0], -1.0),
        (inside[1], np.cross(base, d), both[1], 1.0),
    ):
        one = np.zeros((len(d), UNKNOWNS))
        one[:, TURN] = np.einsum("pa,pab->pb", lever @ camera.world_from_cam[:3, :3], -crossing(turned))
        one[:, SHIFT] = sign * normal
        derivatives.append(one * scale[:, None])
    return (normal @ base) * scale, *derivatives


def _base(one: TimedCamera, other: TimedCamera) -> Float64[np.ndarray, "3"]:
    return other.world_from_cam[:3, 3] - one.world_from_cam[:3, 3]


def _inside(corners: Float64[np.ndarray, "pair corner 2"], camera: TimedCamera) -> Float64[np.ndarray, "pair corner 3"]:
    """Directions in the camera's own axes, one metre deep."""
    homogeneous = np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=2)
    return homogeneous @ np.linalg.inv(camera.K).T


def _angles(
    rays: Sequence[Float64[np.ndarray, "pair corner 3"]], base: Float64[np.ndarray, "3"]
) -> list[Float64[np.ndarray, "pair corner"]]:
    """Of rays about a line, from a plane through the first silhouette."""
    along = base / np.linalg.norm(base)
    middle = rays[0].mean(axis=1)
    right = middle - (middle @ along)[:, None] * along
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(along, right)
    return [np.arctan2(np.einsum("pka,pa->pk", r, up), np.einsum("pka,pa->pk", r, right)) for r in rays]
