"""Flights of a sequence's objects: drawn until they stay in the monitored volume, in sight and apart.

On request some of them meet: they pass others nearby, or behind them as a camera sees it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.capture.format import CaptureCamera
from aerojax.core.errors import UserError
from aerojax.simulate.plan.dataset import DatasetConfig
from aerojax.simulate.world.flight import Flight, draw_flight
from aerojax.simulate.world.rigs import BODY_RADIUS, cameras_that_see

_ATTEMPTS = 400
_APART = 2.0  # metres between two objects' origins: twice their size
_PASSING = (2.0, 3.0)
"""Metres at which an object passes another one."""
_BEHIND = (2.2, 7.0)
"""Metres by which it is behind it."""
_ASIDE = 0.2
"""Metres beside the line of sight, standard deviation of each axis: a fifth of an object's size."""


@dataclass(frozen=True, eq=False)
class _Meeting:
    """Where a flight has to be (metres, world) at a moment, which is an index of its frames."""

    moment: int
    place: Float[np.ndarray, "3"]


@dataclass(frozen=True)
class ObjectSpace:
    """Where the origins of objects may be: a box (low, high: its corners, metres, world) before cameras."""

    cameras: tuple[CaptureCamera, ...]
    low: Float[np.ndarray, "3"]
    high: Float[np.ndarray, "3"]


def draw_flights(
    labels: Sequence[str], space: ObjectSpace, config: DatasetConfig, margin: int, rng: np.random.Generator
) -> list[Flight]:
    """Flights that stay in the volume, in sight of enough cameras and apart from each other.

    Args:
        labels: class of each object.
        space: where they may be.
        config: of the data set.
        margin: frames by which flights are longer than the sequence at either end.
        rng: source of every draw.

    Raises:
        UserError: no such flight was found.
    """
    placed: list[Flight] = []
    point = bool(np.all(space.low == space.high))
    for index, label in enumerate(labels):
        # Beside an object that holds the only point of the volume there is room for others around it.
        room = 1.5 * _APART * len(labels) if point and placed else 0.0
        for _ in range(_ATTEMPTS):
            meeting = _meeting(index, placed, space, config, margin, rng)
            flight = _flight_somewhere(label, space, room, meeting, config, margin, rng)
            if flight is not None and all(_apart(flight, other) for other in placed):
                placed.append(flight)
                break
        else:
            message = f"rig {config.rig.name}: no {label} flight of {config.frames} frames stays in the volume and in"
            remedy = "lower rig.max_travel, rig.min_cameras or crowd.objects, or enlarge rig.volume"
            raise UserError("invalid", f"{message} sight of {config.rig.min_cameras} cameras", remedy)
    return placed


def _meeting(
    index: int,
    placed: Sequence[Flight],
    space: ObjectSpace,
    config: DatasetConfig,
    margin: int,
    rng: np.random.Generator,
) -> _Meeting | None:
    """Where the object meets one that is placed, in the middle third of the sequence; None if it need not."""
    crowd = config.crowd
    if not 0 < index <= crowd.crossings + crowd.occlusions:
        return None
    third = config.frames // 3
    moment = margin + int(rng.integers(third, config.frames - third))
    other = placed[int(rng.integers(len(placed)))].position[moment]
    if index <= crowd.crossings:
        aside = rng.normal(size=3)
        return _Meeting(moment, other + rng.uniform(*_PASSING) * aside / np.linalg.norm(aside))
    ray = other - space.cameras[int(rng.integers(len(space.cameras)))].world_from_cam[:3, 3]
    return _Meeting(moment, other + rng.uniform(*_BEHIND) * ray / np.linalg.norm(ray) + rng.normal(0.0, _ASIDE, 3))


def _flight_somewhere(
    label: str,
    space: ObjectSpace,
    room: float,
    meeting: _Meeting | None,
    config: DatasetConfig,
    margin: int,
    rng: np.random.Generator,
) -> Flight | None:
    rig = config.rig
    flight = draw_flight(
        label,
        frames=config.frames + 2 * margin,
        fps=config.fps,
        motion=rig.motion,
        rng=rng,
        max_travel=rig.max_travel,
    )
    if rig.max_acceleration > 0 and _acceleration(flight, config.fps) > rig.max_acceleration:
        return None
    if meeting is None:
        position = flight.position + rng.uniform(space.low - room, space.high + room)
    else:
        position = flight.position - flight.position[meeting.moment] + meeting.place
    point = bool(np.all(space.low == space.high))
    inside = point or bool(np.all((position >= space.low) & (position <= space.high)))
    if not inside:
        return None
    seen = cameras_that_see(position, space.cameras, BODY_RADIUS)
    near = min(float(np.linalg.norm(position - c.world_from_cam[:3, 3], axis=1).min()) for c in space.cameras)
    # A lone object in the middle of a fixed sphere is where the thesis has it, even if it fills the image.
    thesis = point and room == 0.0 and near > BODY_RADIUS
    return Flight(position, flight.world_from_body) if thesis or seen.min() >= rig.min_cameras else None


def _acceleration(flight: Flight, fps: float) -> float:
    """The greatest of a flight, m/s²."""
    change = np.diff(flight.position, 2, axis=0) * fps**2
    return float(np.linalg.norm(change, axis=1).max(initial=0.0))


def _apart(flight: Flight, other: Flight) -> bool:
    return bool(np.linalg.norm(flight.position - other.position, axis=1).min() > _APART)
