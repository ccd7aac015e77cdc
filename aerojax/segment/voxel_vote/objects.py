"""Which objects of this frame were there before: numbers, and who is believed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64
from scipy.optimize import linear_sum_assignment

from aerojax.segment.voxel_vote.cluster import Candidate


@dataclass(frozen=True)
class ObjectsConfig:
    """When a candidate is an object.

    confirm: frames in which it was found; one is enough where all of at least four cameras that see the place agree.
    speed: largest, metres a second: how far from its last place it is looked for.
    gone_after: frames without it after which it is forgotten.
    still_after: frames without a change in two images after which it is background.
    """

    confirm: int = 2
    speed: float = 80.0
    gone_after: int = 15
    still_after: int = 60


@dataclass(frozen=True, eq=False)
class Known:
    """One object over time.

    number: of the object, from 1. centre, velocity: metres, metres a second. size: metres. time_s: of the last frame
    with it. found, missed: frames with it, and since the last one. still: frames since its images last changed; None as
    long as they never did. light: frames in which it looked like the background in other light. believed: whether
    it was found often enough to be an object.
    """

    number: int
    centre: Float64[np.ndarray, "3"]
    velocity: Float64[np.ndarray, "3"]
    size: float
    time_s: float
    found: int = 1
    missed: int = 0
    still: int | None = None
    light: int = 0
    believed: bool = False

    @property
    def shadow(self) -> bool:
        """Whether it looked like other light in a third of its frames: where it is thin, its rim hides that in some."""
        return 3 * self.light >= self.found


def linked(
    known: Sequence[Known],
    found: Sequence[Candidate],
    changing: Sequence[bool],
    light: Sequence[bool],
    time_s: float,
    numbers: int,
    config: ObjectsConfig,
) -> tuple[list[Known], list[Known]]:
    """The objects of this frame, in the order of `found`, and those that are only remembered.

    Args:
        known: of the frame before.
        found: of this one.
        changing: whether at least two cameras see each of them change since the last frame.
        light: whether each looks like background in other light.
        time_s: of this frame.
        numbers: given so far.
    """
    pairs, now = _assigned(known, found, time_s, config), []
    for index, (one, changes, lit) in enumerate(zip(found, changing, light, strict=True)):
        before = pairs.get(index)
        if before is None:
            numbers += 1
            entry = Known(numbers, one.centre, np.zeros(3), one.size, time_s, still=0 if changes else None)
        else:
            entry = _moved(known[before], one, changes, time_s)
        certain = one.votes == one.watched and one.watched >= 4
        entry = replace(entry, light=entry.light + lit)
        new = entry.still is not None and one.clear and (certain or entry.found >= config.confirm)
        believed = entry.believed or new
        now.append(replace(entry, believed=believed))
    kept = set(pairs.values())
    lost = [replace(one, missed=one.missed + 1) for index, one in enumerate(known) if index not in kept]
    return now, [one for one in lost if one.missed <= (config.gone_after if one.believed else 1)]


def _assigned(
    known: Sequence[Known], found: Sequence[Candidate], time_s: float, config: ObjectsConfig
) -> dict[int, int]:
    """Which of `known` each of `found` is: least squared distances to where it should be, none beyond its reach."""
    if not known or not found:
        return {}
    elapsed = np.array([time_s - one.time_s for one in known])
    ahead = np.stack([one.centre + one.velocity * dt for one, dt in zip(known, elapsed, strict=True)])
    # Its speed is known from the second frame on; a tenth of the largest is what it may have changed by since.
    reach = [
        one.size + config.speed * dt * (1.0 if one.found == 1 else 0.1) for one, dt in zip(known, elapsed, strict=True)
    ]
    apart = np.linalg.norm(np.stack([one.centre for one in found])[:, None] - ahead, axis=-1)
    allowed = apart <= np.array(reach)
    rows, columns = linear_sum_assignment(np.where(allowed, apart, 1e6))
    return {int(r): int(c) for r, c in zip(rows, columns, strict=True) if allowed[r, c]}


def _moved(before: Known, now: Candidate, changes: bool, time_s: float) -> Known:
    elapsed = time_s - before.time_s
    velocity = (now.centre - before.centre) / elapsed if elapsed > 0 else before.velocity
    if before.found > 1:
        velocity = 0.5 * (velocity + before.velocity)
    still = 0 if changes else None if before.still is None else before.still + 1
    return replace(
        before,
        centre=now.centre,
        velocity=velocity,
        size=0.5 * (before.size + now.size),
        time_s=time_s,
        found=before.found + 1,
        missed=0,
        still=still,
    )
