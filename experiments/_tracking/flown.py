"""Flights of several objects before a network, without images: the scenes of detections alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64
from scipy.interpolate import CubicSpline

from aerojax.core.config import require_at_least
from aerojax.core.seeds import number_of
from aerojax.core.types import CLASSES
from aerojax.evaluate.tracking import TrackingFrame
from aerojax.simulate.plan.dataset import CrowdConfig, DatasetConfig, RigConfig
from aerojax.simulate.plan.flights import ObjectSpace, draw_flights
from aerojax.simulate.world.fixed_rigs import conditions, place_cameras
from aerojax.track.offline import Following
from aerojax.track.sights import TimedCamera, timed
from aerojax.track.simulated import DetectorConfig, Path

MARGIN_S = 0.4
"""By which flights are longer than what is seen: clocks are wrong by up to 0.3 s with their rates."""


@dataclass(frozen=True)
class FlownConfig:
    """Flights that no image shows.

    rig: fixed cameras and the volume before them.
    frames: of each camera.
    fps: of each camera, by its own clock.
    fewest, most: objects; a drone, a bird and any classes; the second passes the first one, the third passes behind.
    detector: of every camera.
    """

    rig: RigConfig
    frames: int = 600
    fps: float = 30.0
    fewest: int = 2
    most: int = 5
    detector: DetectorConfig = field(default_factory=DetectorConfig)

    def __post_init__(self) -> None:
        require_at_least(self, "frames", least=30)
        require_at_least(self, "fewest", least=2)
        require_at_least(self, "most", least=self.fewest)


@dataclass(frozen=True, eq=False)
class Flown:
    """One scene: cameras that are all synchronised, and the objects' paths. rng: for what is seen of it."""

    cameras: tuple[TimedCamera, ...]
    paths: tuple[Path, ...]
    rng: np.random.Generator


def fly(config: FlownConfig, seed: int, number: int) -> Flown:
    """The scene of that number; by the seed and it alone.

    Raises:
        UserError: the rig is none of fixed cameras, or its volume has no place for so many flights.
    """
    rng = np.random.default_rng(number_of(seed, f"flown_{number}"))
    assert config.rig.fixed is not None  # conf/measure_tracking.yaml names such a rig
    cameras = place_cameras(config.rig.fixed, conditions(config.rig.fixed)[0])
    count = config.fewest + number % (config.most - config.fewest + 1)
    labels = ["drone", "bird", *(str(name) for name in rng.choice(CLASSES, count - 2))]
    crowd = CrowdConfig(objects=count, crossings=1, occlusions=min(1, count - 2))
    dataset = DatasetConfig(rig=config.rig, frames=config.frames, fps=config.fps, crowd=crowd)
    margin = int(np.ceil(MARGIN_S * config.fps))
    space = ObjectSpace(cameras, np.array(config.rig.volume.low), np.array(config.rig.volume.high))
    flights = draw_flights(labels, space, dataset, margin, rng)
    seconds = (np.arange(config.frames + 2 * margin) - margin) / config.fps
    paths = tuple(CubicSpline(seconds, flight.position) for flight in flights)
    return Flown(tuple(timed(camera) for camera in cameras), paths, rng)


def beside_paths(following: Following, paths: Sequence[Path]) -> list[TrackingFrame]:
    """Believed tracks beside what flew, a frame for every moment."""
    frames = []
    for moment in following.moments:
        truth = np.stack([one(np.array([moment.time_s]))[0] for one in paths])
        ids = np.array([one.number for one in moment.tracks], np.int64)
        places: Float64[np.ndarray, "track 3"] = np.array([one.mean[:3] for one in moment.tracks]).reshape(-1, 3)
        frames.append(TrackingFrame(np.arange(len(paths)), truth, ids, places))
    return frames
