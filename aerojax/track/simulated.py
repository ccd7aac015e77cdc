"""What the detectors of a network would say of known paths: noise, misses, false alarms, one object behind another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from aerojax.track.sights import Detections, TimedCamera, sight_of_points

Path = Callable[[Float64[np.ndarray, "_"]], Float64[np.ndarray, "_ 3"]]
"""Where an object is (metres, world) at moments (seconds of the network's clock)."""
FALSE = -1
"""Source of a detection that is of no path."""
_SHUTTER_ROUNDS = 4
"""In which the row that an object is seen in is found; the first one leaves a thousandth of the readout."""


@dataclass(frozen=True)
class DetectorConfig:
    """How good the detectors are.

    noise_px: standard deviation of a detection along each axis, pixels.
    missed: share of detections that are missing.
    false_alarms: in an image, mean of a Poisson number, anywhere in it.
    merge_px: of objects nearer to each other in an image only the one in front is detected.
    """

    noise_px: float = 1.0
    missed: float = 0.1
    false_alarms: float = 1.0
    merge_px: float = 10.0


@dataclass(frozen=True, eq=False)
class Watched:
    """What was seen, and what was there: source is the path's index of each detection, or `FALSE`."""

    detections: Detections
    source: Int64[np.ndarray, "sight"]


def watch(
    paths: Sequence[Path],
    cameras: Sequence[TimedCamera],
    *,
    frames: int,
    fps: float,
    config: DetectorConfig,
    stagger: bool,
    rng: np.random.Generator,
) -> Watched:
    """Detections of all cameras by their own clocks.

    Args:
        paths: of the objects, which are points.
        cameras: without distortion, as they are in truth.
        frames: of each camera. fps: of each camera's own clock.
        config: of the detectors.
        stagger: whether each camera takes its images at a phase of its own; all begin together otherwise.
        rng: source of every draw.
    """
    parts, sources = [], []
    for index, camera in enumerate(cameras):
        stamps = (np.arange(frames) + (rng.uniform(0, 1) if stagger else 0.0)) / fps
        views = [_view(one, camera, stamps) for one in paths]
        pixels, depth = np.stack([p for p, _ in views]), np.stack([d for _, d in views])
        seen = (depth > 0) & np.all((pixels > 0) & (pixels < [camera.width, camera.height]), axis=-1)
        apart = np.linalg.norm(pixels[:, None] - pixels[None], axis=-1)
        seen &= ~np.any((apart < config.merge_px) & (depth[:, None] > depth[None]), axis=1)
        seen &= rng.uniform(size=seen.shape) >= config.missed
        number, moment = np.nonzero(seen)
        noisy = pixels[seen] + rng.normal(0, config.noise_px, (len(number), 2))
        at = np.repeat(stamps, rng.poisson(config.false_alarms, len(stamps)))
        false = rng.uniform([0, 0], [camera.width, camera.height], (len(at), 2))
        count = len(number) + len(at)
        parts.append((np.full(count, index), np.concatenate([stamps[moment], at]), np.concatenate([noisy, false])))
        sources.append(np.concatenate([number, np.full(len(at), FALSE)]))
    camera, stamp, pixels = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Watched(Detections(camera, stamp, pixels, np.zeros(len(camera))), np.concatenate(sources))


def _view(
    one: Path, camera: TimedCamera, stamps: Float64[np.ndarray, "image"]
) -> tuple[Float64[np.ndarray, "image 2"], Float64[np.ndarray, "image"]]:
    """Pixels and depths in images of these stamps; of a rolling shutter, the row says when, and that where."""

    def shown(row: Float64[np.ndarray, "image"]) -> tuple[Float64[np.ndarray, "image 2"], Float64[np.ndarray, "image"]]:
        pixels, _, depth = sight_of_points(one(camera.network_time(stamps, row)), camera)
        return pixels, depth

    pixels, depth = shown(np.full(len(stamps), camera.height / 2))
    for _ in range(_SHUTTER_ROUNDS - 1):
        pixels, depth = shown(pixels[:, 1])
    return pixels, depth
