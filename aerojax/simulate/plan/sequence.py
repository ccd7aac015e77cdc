"""From a sequence's name and seed to a planned scene: who flies where, cameras, light, and what is misstated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from aerojax.capture.format import CaptureCamera
from aerojax.core.errors import UserError
from aerojax.simulate.assets.catalogue import Identity, build_identity
from aerojax.simulate.plan.dataset import CampaignConfig, FaultConfig, SequenceTask, cast_of, station_of
from aerojax.simulate.plan.single import draw_dome_light, draw_skies, sequence_seed
from aerojax.simulate.record import Actor, ScenePlan, image_patterns
from aerojax.simulate.render.outdoors import Outdoors
from aerojax.simulate.render.scene import Dome, Environment
from aerojax.simulate.world.fixed_rigs import BODY_RADIUS, cameras_that_see, conditions, place_cameras
from aerojax.simulate.world.flight import Flight, draw_flight
from aerojax.simulate.world.landscape import SceneryConfig, build_scenery
from aerojax.simulate.world.rigs import draw_rig
from aerojax.simulate.world.sensor import SensorConfig, draw_lighting, draw_sensor
from aerojax.simulate.world.sky import SkyConfig
from kernels.rays.landscape import LandscapeCaster, LandscapeMesh

_ATTEMPTS = 400
_APART = 2.0  # metres between two objects' origins: twice their size


@dataclass(frozen=True)
class Stage:
    """The empty scene of a sequence: cameras, where objects may be, and how far from the cameras that is.

    low, high: corners of the box that origins stay in, metres, world.
    """

    cameras: tuple[CaptureCamera, ...]
    low: Float[np.ndarray, "3"]
    high: Float[np.ndarray, "3"]


def draw_scene(task: SequenceTask, config: CampaignConfig, assets: Path) -> ScenePlan:
    """Plan one sequence; everything follows from its name and the data set's seed.

    Args:
        task: which sequence.
        config: of the data set.
        assets: folder of the identities' stages; missing ones are built.

    Raises:
        UserError: the volume has no place that enough cameras see.
    """
    seeds = np.random.SeedSequence(sequence_seed(config.seed, task.name)).spawn(5)
    rig_rng, flight_rng, light_rng, fault_rng, cast_rng = (np.random.default_rng(seed) for seed in seeds)
    stage = _draw_stage(task, config, rig_rng)
    offsets = fault_rng.uniform(-1.0, 1.0, len(stage.cameras)) * config.faults.time_offset_s
    margin = 1 + math.ceil(config.faults.time_offset_s * config.fps)
    flown = _companions(task.identity, config, cast_rng)
    flights = _draw_flights([i.label for i in flown], stage, config, margin, flight_rng)
    actors = tuple(
        _actor(identity, assets, flight, float(flight_rng.uniform(0.0, 10.0)))
        for identity, flight in zip(flown, flights, strict=True)
    )
    cameras = tuple(
        replace(image_patterns(camera, config.images), time_offset_s=float(offset))
        for camera, offset in zip(stage.cameras, offsets, strict=True)
    )
    calibration = tuple(misstated(camera, config.faults, fault_rng) for camera in cameras)
    environment, landscape = _environment(task, config, cameras, light_rng)
    return ScenePlan(
        actors,
        cameras,
        calibration,
        environment,
        config.images,
        config.frames,
        config.fps,
        margin,
        sensors=_sensors(config, len(cameras), fault_rng),
        noise_seed=int(fault_rng.integers(2**31)),
        landscape=landscape,
    )


def _sensors(config: CampaignConfig, cameras: int, rng: np.random.Generator) -> tuple[SensorConfig, ...]:
    if config.randomisation == 0:
        return (config.sensor,) * cameras
    return tuple(draw_sensor(config.sensor, config.randomisation, rng=rng) for _ in range(cameras))


def _draw_stage(task: SequenceTask, config: CampaignConfig, rng: np.random.Generator) -> Stage:
    station = station_of(config)
    volume = config.rig.volume
    if station is None:
        origin = np.array([*rng.uniform(-2.0, 2.0, 2), rng.uniform(6.0, 14.0)])
        cameras = draw_rig(config.rig.rigs[rng.integers(len(config.rig.rigs))], origin, rng)
        return Stage(cameras, origin + np.array(volume.low), origin + np.array(volume.high))
    cameras = place_cameras(station, conditions(station)[task.condition])
    return Stage(cameras, np.array(volume.low), np.array(volume.high))


def _companions(identity: Identity, config: CampaignConfig, rng: np.random.Generator) -> list[Identity]:
    """The identity and those that fly with it, all of its split and no one twice.

    Raises:
        UserError: the split has too few.
    """
    others = [i for i in cast_of(config)[identity.split] if i.name != identity.name]
    wanted = config.crowd.objects - 1
    if wanted > len(others):
        raise UserError(
            "out-of-range",
            f"crowd.objects is {config.crowd.objects}, {identity.split} has {len(others) + 1}",
            "lower it",
        )
    chosen = [others[i] for i in rng.permutation(len(others))[:wanted]]
    birds = [i for i in others if i.label == "bird" and i not in chosen]
    if config.crowd.birds > len(birds):
        raise UserError(
            "out-of-range", f"crowd.birds is {config.crowd.birds}, {identity.split} has {len(birds)} left", "lower it"
        )
    return [identity, *chosen, *(birds[i] for i in rng.permutation(len(birds))[: config.crowd.birds])]


def _actor(identity: Identity, assets: Path, flight: Flight, phase: float) -> Actor:
    stage = build_identity(identity, assets)
    if identity.model is None:
        return Actor(identity, stage, flight, phase)
    model = identity.model
    return Actor(identity, stage, flight, phase, model.source or model.file.name, model.licence or "unknown")


def _draw_flights(
    labels: list[str], stage: Stage, config: CampaignConfig, margin: int, rng: np.random.Generator
) -> list[Flight]:
    """Flights that stay in the volume, in sight of enough cameras and apart from each other.

    Raises:
        UserError: no such flight was found.
    """
    placed: list[Flight] = []
    point = bool(np.all(stage.low == stage.high))
    for label in labels:
        # Beside an object that holds the only point of the volume there is room for others around it.
        room = 1.5 * _APART * len(labels) if point and placed else 0.0
        for _ in range(_ATTEMPTS):
            flight = _flight_somewhere(label, stage, room, config, margin, rng)
            if flight is not None and all(_apart(flight, other) for other in placed):
                placed.append(flight)
                break
        else:
            message = f"rig {config.rig.name}: no {label} flight of {config.frames} frames stays in the volume and in"
            remedy = "lower rig.max_travel, rig.min_cameras or crowd.objects, or enlarge rig.volume"
            raise UserError("invalid", f"{message} sight of {config.rig.min_cameras} cameras", f"{remedy}")
    return placed


def _flight_somewhere(
    label: str, stage: Stage, room: float, config: CampaignConfig, margin: int, rng: np.random.Generator
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
    position = flight.position + rng.uniform(stage.low - room, stage.high + room)
    point = bool(np.all(stage.low == stage.high))
    inside = point or bool(np.all((position >= stage.low) & (position <= stage.high)))
    if not inside:
        return None
    seen = cameras_that_see(position, stage.cameras, BODY_RADIUS)
    near = min(float(np.linalg.norm(position - c.world_from_cam[:3, 3], axis=1).min()) for c in stage.cameras)
    # A lone object in the middle of a station's sphere is where the thesis has it, even if it fills the image.
    thesis = point and room == 0.0 and near > BODY_RADIUS
    return Flight(position, flight.world_from_body) if thesis or seen.min() >= rig.min_cameras else None


def _apart(flight: Flight, other: Flight) -> bool:
    return bool(np.linalg.norm(flight.position - other.position, axis=1).min() > _APART)


def misstated(camera: CaptureCamera, faults: FaultConfig, rng: np.random.Generator) -> CaptureCamera:
    """The camera as an imperfect calibration describes it; its clock's offset is exact."""
    turn, shift, stretch = rng.normal(size=3), rng.normal(size=3), rng.normal()
    pose, intrinsics = camera.world_from_cam.copy(), camera.K.copy()
    if faults.rotation_deg > 0:
        axis = turn / np.linalg.norm(turn)
        angle = np.deg2rad(faults.rotation_deg) * rng.normal()
        pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(angle * axis).as_matrix()
    pose[:3, 3] += faults.position_m * shift
    intrinsics[[0, 1], [0, 1]] *= 1 + faults.focal_percent / 100 * stretch
    return replace(camera, world_from_cam=pose, K=intrinsics)


def _environment(
    task: SequenceTask, config: CampaignConfig, cameras: tuple[CaptureCamera, ...], rng: np.random.Generator
) -> tuple[Environment, LandscapeMesh | None]:
    if config.rig.environment == "outdoor":
        return _outdoors(task, config, cameras, rng)
    light = draw_dome_light(rng)
    if config.randomisation > 0:
        light = draw_lighting(light, config.randomisation, rng=rng)
    if config.rig.environment == "white":
        return Dome(light=light), None
    by_camera = dict(zip((c.name for c in cameras), draw_skies(len(cameras), rng), strict=True))
    return Dome(light=light, by_camera=by_camera), None


def _outdoors(
    task: SequenceTask, config: CampaignConfig, cameras: tuple[CaptureCamera, ...], rng: np.random.Generator
) -> tuple[Environment, LandscapeMesh | None]:
    """The site's landscape and a day of its own for every sequence: clear to hazy, cloudy or not, low to high sun."""
    sky = SkyConfig(
        turbidity=rng.uniform(2.0, 5.0),
        sun_azimuth=rng.uniform(0.0, 360.0),
        sun_elevation=rng.uniform(15.0, 65.0),
        sun_azimuth_rate=config.rig.sun_rate,
        cloud_cover=rng.uniform(0.0, 0.7),
        visibility=10 ** rng.uniform(3.6, 4.5),
        exposure=rng.uniform(0.8, 1.2),
    )
    clear = tuple((float(c.world_from_cam[0, 3]), float(c.world_from_cam[1, 3])) for c in cameras)
    seed = sequence_seed(config.seed, f"{site_of(task, config)}/landscape") % 2**31
    landscape, caster = _site(config.rig.scenery, clear, seed)
    return Outdoors(landscape, sky, caster=caster), landscape


def site_of(task: SequenceTask, config: CampaignConfig) -> str:
    """Which landscape a sequence is flown over: one of the rig's sites, or its own."""
    sites = config.rig.sites
    return f"site_{sequence_seed(config.seed, task.name) % sites:03d}" if sites else task.name


@lru_cache(maxsize=1)
def _site(
    scenery: SceneryConfig, clear: tuple[tuple[float, float], ...], seed: int
) -> tuple[LandscapeMesh, LandscapeCaster]:
    """A landscape and its caster, kept for the next sequence at the same site."""
    landscape = build_scenery(scenery, np.array(clear), seed=seed)
    return landscape, LandscapeCaster(landscape)
