"""What sights say of the cameras' unknowns once all else has followed: curvature, slope, and what is worth a change.

Which of the cameras are wrong, and in what, is chosen by penalised likelihood (Schwarz 1978): a part of a camera is
corrected where that explains the sights better by more than numbers that mean nothing would. What is right is so left
alone, and a camera that was turned is not thought moved, which looks nearly alike to objects in a small field.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float64

from aerojax.track.adjust.corrections import OFFSET_RATE, SHIFT, TURN, UNKNOWNS

PARTS: tuple[slice, ...] = (OFFSET_RATE, TURN, SHIFT)
"""Of a camera that are right or wrong as a whole."""
_MOST_CHANGES = 20

Looked = Bool[np.ndarray, "camera 9"]
_Guess = TypeVar("_Guess")


@dataclass(frozen=True, eq=False)
class Evidence:
    """About a guess, all cameras' unknowns in their order: cost ≈ constant + 2·slopeᵀx + xᵀ·curvature·x for a step x.

    penalty: what an unknown has to lower the cost by, to be worth it.
    spread: by how much the sights' variances are larger than was thought.
    """

    curvature: Float64[np.ndarray, "unknown unknown"]
    slope: Float64[np.ndarray, "unknown"]
    penalty: float
    spread: float = 1.0

    def at(self, stamp_s: float) -> Evidence:
        """With the clocks' offsets counted at that moment of each clock instead of at 0."""
        step = np.eye(len(self.slope))
        for offset in range(0, len(self.slope), UNKNOWNS):
            step[offset, offset + 1] = -stamp_s
        return replace(self, curvature=step.T @ self.curvature @ step, slope=step.T @ self.slope)

    def lowered(self, looked: Looked) -> float:
        """By how much the best step of what is looked for lowers the cost."""
        places = np.flatnonzero(looked)
        if len(places) == 0:
            return 0.0
        slope = self.slope[places]
        return float(slope @ np.linalg.solve(self.curvature[np.ix_(places, places)], slope))

    def covariance(self, looked: Looked) -> Float64[np.ndarray, "looked looked"]:
        """Of what is looked for, in its order."""
        places = np.flatnonzero(looked)
        return self.spread * np.linalg.inv(self.curvature[np.ix_(places, places)])

    def sigmas(self, looked: Looked, may: Looked) -> Float64[np.ndarray, "camera 9"]:
        """Standard deviations of what is looked for, and of each part that could be if it were, too; 0 of the rest."""
        found = np.zeros(looked.shape)
        found[looked] = np.sqrt(np.diag(self.covariance(looked)))
        for part in _parts(looked):
            wider = looked | (part & may)
            if np.any(wider & ~looked):
                new = np.zeros(looked.shape)
                new[wider] = np.sqrt(np.diag(self.covariance(wider)))
                found[part & ~looked] = new[part & ~looked]
        return found


@runtime_checkable
class Model(Protocol[_Guess]):
    """What is to be explained, and how a guess is made better."""

    def solved(self, looked: Looked, guess: _Guess) -> tuple[_Guess, float]:
        """The best guess with what is looked for, all else of the cameras as given; and its cost."""
        ...

    def evidence(self, guess: _Guess) -> Evidence:
        """About a guess."""
        ...

    def values(self, guess: _Guess) -> Float64[np.ndarray, "camera 9"]:
        """The cameras' corrections."""
        ...


def choose(model: Model[_Guess], looked: Looked, may: Looked, guess: _Guess) -> tuple[Looked, _Guess]:
    """What to look for, and the best guess with it.

    Args:
        model: of the sights.
        looked: to begin with. may: all that could be looked for.
        guess: to begin with.
    """
    guess, cost = model.solved(looked, guess)
    for _ in range(_MOST_CHANGES):
        about = model.evidence(guess)
        now = about.lowered(looked)
        gains = [(about.lowered(wider) - now - _price(about, wider & ~looked), wider) for wider in _wider(looked, may)]
        best = max(gains, key=lambda one: one[0], default=(0.0, looked))
        if best[0] <= 0:
            break
        trial, spent = model.solved(best[1], guess)
        if cost - spent < _price(about, best[1] & ~looked):
            break
        looked, guess, cost = best[1], trial, spent
    looked, guess, cost = _pruned(model, looked, guess, cost)
    return _exchanged(model, looked, may, guess, cost)


def _price(about: Evidence, looked: Looked) -> float:
    return about.penalty * about.spread * float(np.count_nonzero(looked))


def _parts(looked: Looked) -> list[Looked]:
    """Masks of every part of every camera."""
    found = []
    for camera in range(len(looked)):
        for part in PARTS:
            mask = np.zeros(looked.shape, bool)
            mask[camera, part] = True
            found.append(mask)
    return found


def _wider(looked: Looked, may: Looked) -> list[Looked]:
    return [looked | (part & may) for part in _parts(looked) if np.any(part & may & ~looked)]


def _pruned(model: Model[_Guess], looked: Looked, guess: _Guess, cost: float) -> tuple[Looked, _Guess, float]:
    """Without the parts that are not worth it, the least first."""
    for _ in range(_MOST_CHANGES):
        about, values = model.evidence(guess), model.values(guess)
        covariance = about.covariance(looked)
        worst, least = None, 0.0
        for part in _parts(looked):
            own = part[looked]
            if not own.any():
                continue
            off = values[part & looked]
            worth = off @ np.linalg.solve(covariance[np.ix_(own, own)], off) * about.spread
            spare = worth - _price(about, part & looked)
            if spare < least:
                worst, least = part, spare
        if worst is None:
            break
        narrower = looked & ~worst
        guess, cost = model.solved(narrower, guess)
        looked = narrower
    return looked, guess, cost


def _exchanged(model: Model[_Guess], looked: Looked, may: Looked, guess: _Guess, cost: float) -> tuple[Looked, _Guess]:
    """Where a camera is thought turned or moved, and the other explains more: the other."""
    for camera in range(len(looked)):
        turned, shifted = looked[camera, TURN].any(), looked[camera, SHIFT].any()
        if turned == shifted:
            continue
        other = looked.copy()
        other[camera, TURN], other[camera, SHIFT] = shifted & may[camera, TURN], turned & may[camera, SHIFT]
        trial, spent = model.solved(other, guess)
        if spent < cost:
            looked, guess, cost = other, trial, spent
    return looked, guess
