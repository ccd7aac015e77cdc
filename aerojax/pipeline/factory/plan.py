"""One clip, decided before the first ray: who flies how before which cameras, in which light, with which faults."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import CaptureCamera
from aerojax.core.seeds import number_of
from aerojax.pipeline.factory.config import (
    FactoryConfig,
    FaultRanges,
    FlightRanges,
    draw_fault,
    draw_whole_fault,
    log_uniform,
    uniform,
)
from aerojax.pipeline.factory.rigs import draw_cameras
from aerojax.simulate.assets.catalogue import Identity
from aerojax.simulate.plan.dataset import FaultConfig
from aerojax.simulate.plan.environment import draw_dome_light, draw_sky_colours
from aerojax.simulate.plan.planner import perturbed_calibration
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from aerojax.simulate.world.flight import Flight, Motion
from aerojax.simulate.world.passive_flight import draw_motion
from aerojax.simulate.world.sensor import SensorConfig, draw_lighting, draw_sensor

_FIELD_SHARE = 0.4
"""Of the width that the cameras see at the object, so much may a flight span."""


@dataclass(frozen=True)
class Faults:
    """The drawn faults of one clip; units as in `FaultRanges`."""

    rotation_deg: float
    position_m: float
    focal_percent: float
    clock_ms: float
    lost: int
    mask_threshold: float
    mask_growth: int
    sensor: float


@dataclass(frozen=True)
class ClipPlan:
    """One clip to make.

    cameras: as they stand, with their clocks' offsets; calibration: as they are stated. Lost cameras are left out.
    flight: `margin` frames longer than the clip at both ends; phase: of the animation at frame 0, seconds.
    environment: light and colours behind the object.
    sensors: one a camera. noise_seed: of their noise.
    kind, attempt: of the rig; how many draws came before.
    """

    cameras: tuple[CaptureCamera, ...]
    calibration: tuple[CaptureCamera, ...]
    flight: Flight
    margin: int
    phase: float
    fps: float
    motion: Motion
    environment: Dome
    sensors: tuple[SensorConfig, ...]
    noise_seed: int
    faults: Faults
    kind: str
    attempt: int

    def pose_at(self, moment: float) -> tuple[float, Float64[np.ndarray, "4 4"]]:
        """Seconds of the animation and rigid `world_from_body` at a frame number that need not be whole."""
        return self.phase + moment / self.fps, self.flight.transform_at(moment + self.margin)


def clip_name(identity: Identity, index: int) -> str:
    """The name of an individual's clip number `index`, from which all its draws follow."""
    return f"{identity.name}_c{index:03d}"


def rig_kind(config: FactoryConfig, name: str) -> str:
    """The layout of a clip's cameras, the same in every attempt."""
    return config.rigs.kinds[number_of(config.seed, name, "rig") % len(config.rigs.kinds)]


def plan_clip(
    identity: Identity, mesh: AnimatedMesh, name: str, attempt: int, config: FactoryConfig, *, least_margin: int = 0
) -> ClipPlan:
    """Draw a clip; the same name, attempt, configuration and least margin give the same one.

    Args:
        identity: what flies. mesh: its body.
        name: from `clip_name`.
        attempt: from 0, after draws of which too few frames were usable.
        config: ranges.
        least_margin: frames that the flight begins before the clip and ends after it; more where clocks need more.
            Its length decides the flight, so clips that differ by their clocks alone want the same margin.
    """
    seeds = np.random.SeedSequence(number_of(config.seed, name, attempt)).spawn(4)
    rig_rng, flight_rng, light_rng, fault_rng = (np.random.default_rng(seed) for seed in seeds)
    kind, faults = rig_kind(config, name), draw_faults(config.faults, fault_rng)
    fps = _frame_rate(config.flights, flight_rng)
    phase = uniform(flight_rng, config.flights.phase)
    target = np.array([*flight_rng.uniform(-2.0, 2.0, 2), flight_rng.uniform(6.0, 14.0)])
    field = np.deg2rad(uniform(rig_rng, config.rigs.field_deg))
    middle = mesh.vertices_at(phase + config.frames / 2 / fps).astype(np.float64)
    cameras = draw_cameras(kind, config.rigs, target, middle + target, field, rig_rng)
    motion: Motion = "in_place" if flight_rng.uniform() < config.flights.in_place else "flight"
    margin = max(least_margin, 1 + math.ceil(faults.clock_ms / 1e3 * fps))
    flight = draw_motion(
        identity.moves_like,
        frames=config.frames + 2 * margin,
        fps=fps,
        motion=motion,
        rng=flight_rng,
        max_travel=min(log_uniform(flight_rng, config.flights.max_travel), _room(cameras, target)),
    )
    return ClipPlan(
        *_recording(cameras, faults, config, fault_rng),
        flight=Flight(flight.position + target, flight.world_from_body),
        margin=margin,
        phase=phase,
        fps=fps,
        motion=motion,
        environment=_environment(cameras, light_rng),
        sensors=tuple(draw_sensor(SensorConfig(), faults.sensor, rng=fault_rng) for _ in cameras),
        noise_seed=int(fault_rng.integers(2**31)),
        faults=faults,
        kind=kind,
        attempt=attempt,
    )


def draw_faults(ranges: FaultRanges, rng: np.random.Generator) -> Faults:
    """One clip's faults."""
    none = ranges.without
    return Faults(
        rotation_deg=draw_fault(rng, ranges.rotation_deg, none),
        position_m=draw_fault(rng, ranges.position_m, none),
        focal_percent=draw_fault(rng, ranges.focal_percent, none),
        clock_ms=draw_fault(rng, ranges.clock_ms, none),
        lost=draw_whole_fault(rng, ranges.lost, none),
        mask_threshold=uniform(rng, ranges.mask_threshold),
        mask_growth=draw_whole_fault(rng, ranges.mask_growth, none),
        sensor=draw_fault(rng, ranges.sensor, none),
    )


def _frame_rate(ranges: FlightRanges, rng: np.random.Generator) -> float:
    other = uniform(rng, ranges.fps)
    return ranges.usual_fps if rng.uniform() < ranges.usual else other


def _room(cameras: tuple[CaptureCamera, ...], target: np.ndarray) -> float:
    """Metres that a flight may span: a share of the narrowest view's width at the target."""
    distance = [float(np.linalg.norm(camera.world_from_cam[:3, 3] - target)) for camera in cameras]
    return _FIELD_SHARE * min(d * c.height / c.K[1, 1] for d, c in zip(distance, cameras, strict=True))


def _recording(
    cameras: tuple[CaptureCamera, ...], faults: Faults, config: FactoryConfig, rng: np.random.Generator
) -> tuple[tuple[CaptureCamera, ...], tuple[CaptureCamera, ...]]:
    """The cameras that record, with their clocks, and the same as they are stated."""
    offsets = rng.uniform(-1.0, 1.0, len(cameras)) * faults.clock_ms / 1e3
    stated = FaultConfig(faults.rotation_deg, faults.position_m, faults.focal_percent)
    calibration = [perturbed_calibration(camera, stated, rng) for camera in cameras]
    late = [replace(camera, time_offset_s=float(offset)) for camera, offset in zip(cameras, offsets, strict=True)]
    kept = max(len(cameras) - faults.lost, config.pipeline.min_views)
    chosen = np.sort(rng.permutation(len(cameras))[:kept])
    return tuple(late[i] for i in chosen), tuple(calibration[i] for i in chosen)


def _environment(cameras: tuple[CaptureCamera, ...], rng: np.random.Generator) -> Dome:
    """A white dome, one sky colour a camera, or one colour of the land a camera, in a light of its own."""
    light = draw_lighting(draw_dome_light(rng), rng.uniform(), rng=rng)
    skies = draw_sky_colours(len(cameras), rng)
    land = rng.uniform([0.15, 0.2, 0.1], [0.6, 0.6, 0.45], (len(cameras), 3)).tolist()
    kind = rng.uniform()
    if kind < 0.25:
        return Dome(light=light)
    colours = skies if kind < 0.75 else [(c[0], c[1], c[2]) for c in land]
    return Dome(light=light, by_camera=dict(zip((c.name for c in cameras), colours, strict=True)))
