"""Cameras around a field, objects that fly through it, and what the cameras' detectors say of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aerojax.evaluate.tracking import TrackingFrame
from aerojax.geometry.cameras import look_at
from aerojax.track import simulated
from aerojax.track.offline import Following
from aerojax.track.sights import TimedCamera
from aerojax.track.simulated import DetectorConfig, Watched

FPS = 30.0


def ring(count: int = 4, *, radius: float = 60.0, seed: int = 0) -> tuple[TimedCamera, ...]:
    """Cameras on the ground about a field of some 40 m, 1920×1080."""
    rng = np.random.default_rng(seed)
    cameras = []
    for index in range(count):
        angle = 2 * np.pi * (index + rng.uniform(-0.15, 0.15)) / count
        centre = np.array([radius * np.cos(angle), radius * np.sin(angle), 2.0 + rng.uniform(0, 4)])
        pose = look_at(centre, np.array([0.0, 0.0, 22.0]) + rng.uniform(-2, 2, 3))
        K = np.array([[1300.0, 0, 960], [0, 1300.0, 540], [0, 0, 1]])
        cameras.append(TimedCamera(f"cam_{index:02d}", 1920, 1080, K, "none", (), pose))
    return tuple(cameras)


@dataclass(frozen=True)
class Path:
    """A smooth path: a sum of sines about a middle, metres."""

    middle: np.ndarray
    reach: np.ndarray
    frequency: np.ndarray
    phase: np.ndarray

    def at(self, times: np.ndarray) -> np.ndarray:
        waves = np.sin(2 * np.pi * self.frequency * np.asarray(times)[..., None, None] + self.phase)
        return self.middle + np.sum(self.reach * waves, axis=-2)


def path(rng: np.random.Generator, *, reach: float = 12.0) -> Path:
    """At most some 15 m/s and 15 m/s², through the middle of the field now and then."""
    waves = 3
    size = rng.uniform(0.3, 1.0, (waves, 3)) * np.array([[reach], [reach / 3], [reach / 12]])
    size[:, 2] *= 0.4
    frequency = rng.uniform(0.7, 1.3, (waves, 3)) * np.array([[0.06], [0.15], [0.4]])
    middle = np.array([0.0, 0.0, 22.0]) + rng.normal(0, 1.5, 3)
    return Path(middle, size, frequency, rng.uniform(0, 2 * np.pi, (waves, 3)))


def crossing(rng: np.random.Generator, seconds: float, *, gap: float = 1.5) -> tuple[Path, Path]:
    """Two paths that come within `gap` metres of each other in the middle of the time."""
    one, other = path(rng), path(rng)
    middle = np.array([seconds / 2])
    apart = one.at(middle)[0] - other.at(middle)[0]
    aside = rng.normal(size=3)
    return one, replace(other, middle=other.middle + apart + gap * aside / np.linalg.norm(aside))


def watch(
    paths: Sequence[Path],
    cameras: Sequence[TimedCamera],
    *,
    seconds: float,
    rng: np.random.Generator,
    noise_px: float = 1.0,
    missed: float = 0.1,
    clutter: float = 1.0,
    merge_px: float = 10.0,
    blackout: tuple[float, float] = (0.0, 0.0),
    stagger: bool = False,
) -> Watched:
    """Detections of all cameras by their own clocks; see `aerojax.track.simulated.watch`.

    Args:
        blackout: between which seconds of their own clocks no camera detects the first object.
    """
    config = DetectorConfig(*map(float, (noise_px, missed, clutter, merge_px)))
    places = [one.at for one in paths]
    seen = simulated.watch(places, cameras, frames=int(seconds * FPS), fps=FPS, config=config, stagger=stagger, rng=rng)
    stamps = seen.detections.stamp_s
    shown = (seen.source != 0) | (stamps < blackout[0]) | (stamps >= blackout[1])
    return Watched(seen.detections.chosen(shown), seen.source[shown])


@dataclass(frozen=True)
class Scene:
    """A network, what flies before it, and what was seen."""

    cameras: tuple[TimedCamera, ...]
    paths: tuple[Path, ...]
    watching: Watched


def scene(seed: int, *, seconds: float = 10.0, objects: int | None = None, **how: Any) -> Scene:
    """Four or five cameras, two to five objects of which two cross; all by the seed."""
    rng = np.random.default_rng(seed)
    cameras = ring(4 + seed % 2, seed=seed)
    count = 2 + seed % 4 if objects is None else objects
    paths = (*crossing(rng, seconds), *(path(rng) for _ in range(count - 2)))
    return Scene(cameras, paths, watch(paths, cameras, seconds=seconds, rng=rng, **how))


def frames_of(following: Following, paths: Sequence[Path]) -> list[TrackingFrame]:
    """Believed tracks beside the truth."""
    frames = []
    for moment in following.moments:
        truth = np.stack([one.at(np.array([moment.time_s]))[0] for one in paths])
        ids = np.array([one.number for one in moment.tracks], np.int64)
        means = np.array([one.mean[:3] for one in moment.tracks], np.float64).reshape(-1, 3)
        frames.append(TrackingFrame(np.arange(len(paths)), truth, ids, means))
    return frames
