"""From a seed to a planned scene: who flies where, before which cameras, in which light, and what is stated wrongly.

One planner for both kinds of sequences. Those of a data set draw every decision from a generator of its own, so that a
further choice in one leaves the others as they are; samples draw all of them from one, in the order of the code.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from aerojax.capture.format import CaptureCamera
from aerojax.core.config import require_at_least
from aerojax.core.errors import UserError
from aerojax.core.seeds import number_of
from aerojax.simulate.assets.catalogue import Identity
from aerojax.simulate.plan.dataset import DatasetConfig, FaultConfig, SequenceTask, fixed_rig, identities_by_split
from aerojax.simulate.plan.environment import draw_dome_light, draw_environment, draw_sky_colours
from aerojax.simulate.plan.flights import ObjectSpace, draw_flights
from aerojax.simulate.plan.scene import ScenePlan, flying_object, image_patterns
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.world.fixed_rigs import conditions, place_cameras
from aerojax.simulate.world.flight import Flight, Motion
from aerojax.simulate.world.passive_flight import draw_motion
from aerojax.simulate.world.random_rigs import RandomRigConfig, draw_rig
from aerojax.simulate.world.sensor import SensorConfig, draw_sensor

_LONGEST_PHASE = 10.0  # seconds: several cycles of every animation


@dataclass(frozen=True)
class SequenceConfig:
    """One sequence of one object before a dome, outside any data set.

    rigs: cameras; each sequence draws one of them.
    frames, fps: length and rate.
    motion: `flight`, or `in_place` as in the published Sim-1.
    max_travel: metres that a flight may span.
    samples: rays along each side of a pixel.
    depth: write depth maps.
    white_dome: a white background; otherwise one drawn sky colour a camera.
    """

    rigs: tuple[RandomRigConfig, ...] = (RandomRigConfig(),)
    frames: int = 24
    fps: float = 30.0
    motion: Motion = "flight"
    max_travel: float = 4.0
    samples: int = 3
    depth: bool = True
    white_dome: bool = True

    def __post_init__(self) -> None:
        """Refuse what shows nothing."""
        require_at_least(self, "frames", "samples")
        require_at_least(self, "fps", least=0.01)


def plan_sample(identity: Identity, config: SequenceConfig, *, seed: int, assets: Path) -> ScenePlan:
    """Plan one flight before a rig that is drawn with it.

    Args:
        identity: what flies.
        config: rigs, motion and images.
        seed: decides everything; the same seed gives the same plan.
        assets: folder of the identities' stages; missing ones are built.
    """
    rng = np.random.default_rng(seed)
    target = _draw_target(rng)
    flight = draw_motion(
        identity.moves_like,
        frames=config.frames,
        fps=config.fps,
        motion=config.motion,
        rng=rng,
        max_travel=config.max_travel,
    )
    images = ImageConfig(samples=config.samples, depth=config.depth, coverage=False)
    cameras = tuple(image_patterns(camera, images) for camera in _draw_random_rig(config.rigs, target, rng))
    light, skies = draw_dome_light(rng), draw_sky_colours(len(cameras), rng)
    colours = {} if config.white_dome else dict(zip((c.name for c in cameras), skies, strict=True))
    moved = Flight(flight.position + target, flight.world_from_body)
    flown = flying_object(identity, assets, moved, rng.uniform(0.0, _LONGEST_PHASE))
    environment = Dome(light=light, by_camera=colours)
    return ScenePlan((flown,), cameras, cameras, environment, images, config.frames, config.fps)


def plan_sequence(task: SequenceTask, config: DatasetConfig, assets: Path) -> ScenePlan:
    """Plan one sequence of a data set; everything follows from its name and the data set's seed.

    Args:
        task: which sequence.
        config: of the data set.
        assets: folder of the identities' stages; missing ones are built.

    Raises:
        UserError: the volume has no place that enough cameras see.
    """
    seeds = np.random.SeedSequence(number_of(config.seed, task.name)).spawn(5)
    rig_rng, flight_rng, light_rng, fault_rng, companion_rng = (np.random.default_rng(seed) for seed in seeds)
    space = _draw_space(task, config, rig_rng)
    offsets = fault_rng.uniform(-1.0, 1.0, len(space.cameras)) * config.faults.time_offset_s
    margin = 1 + math.ceil(config.faults.time_offset_s * config.fps)
    flown = _companions(task.identity, config, companion_rng)
    flights = draw_flights([i.label for i in flown], space, config, margin, flight_rng)
    objects = tuple(
        flying_object(identity, assets, flight, flight_rng.uniform(0.0, _LONGEST_PHASE))
        for identity, flight in zip(flown, flights, strict=True)
    )
    cameras = tuple(
        replace(image_patterns(camera, config.images), time_offset_s=float(offset))
        for camera, offset in zip(space.cameras, offsets, strict=True)
    )
    calibration = tuple(perturbed_calibration(camera, config.faults, fault_rng) for camera in cameras)
    environment, landscape = draw_environment(task, config, cameras, light_rng)
    return ScenePlan(
        objects,
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
        surface=config.surface,
    )


def _draw_target(rng: np.random.Generator) -> Float[np.ndarray, "3"]:
    """The point that the cameras of a random rig look at, metres, world."""
    return np.array([*rng.uniform(-2.0, 2.0, 2), rng.uniform(6.0, 14.0)])


def _draw_random_rig(
    rigs: tuple[RandomRigConfig, ...], target: Float[np.ndarray, "3"], rng: np.random.Generator
) -> tuple[CaptureCamera, ...]:
    return draw_rig(rigs[rng.integers(len(rigs))], target, rng)


def _draw_space(task: SequenceTask, config: DatasetConfig, rng: np.random.Generator) -> ObjectSpace:
    fixed, volume = fixed_rig(config), config.rig.volume
    if fixed is None:
        target = _draw_target(rng)
        cameras = _draw_random_rig(config.rig.random, target, rng)
        return ObjectSpace(cameras, target + np.array(volume.low), target + np.array(volume.high))
    cameras = place_cameras(fixed, conditions(fixed)[task.condition])
    return ObjectSpace(cameras, np.array(volume.low), np.array(volume.high))


def _companions(identity: Identity, config: DatasetConfig, rng: np.random.Generator) -> list[Identity]:
    """The identity and those that fly with it, all of its split and no one twice.

    Raises:
        UserError: the split has too few.
    """
    others = [i for i in identities_by_split(config)[identity.split] if i.name != identity.name]
    crowd = config.crowd
    count = int(rng.integers(crowd.objects, crowd.most_objects + 1)) if crowd.most_objects else crowd.objects
    wanted = count - 1
    if wanted > len(others):
        raise UserError(
            "out-of-range",
            f"crowd.objects is {count}, {identity.split} has {len(others) + 1}",
            "lower it",
        )
    chosen = [others[i] for i in rng.permutation(len(others))[:wanted]]
    birds = [i for i in others if i.label == "bird" and i not in chosen]
    if crowd.birds > len(birds):
        raise UserError(
            "out-of-range", f"crowd.birds is {crowd.birds}, {identity.split} has {len(birds)} left", "lower it"
        )
    return [identity, *chosen, *(birds[i] for i in rng.permutation(len(birds))[: crowd.birds])]


def _sensors(config: DatasetConfig, cameras: int, rng: np.random.Generator) -> tuple[SensorConfig, ...]:
    if config.randomisation == 0:
        return (config.sensor,) * cameras
    return tuple(draw_sensor(config.sensor, config.randomisation, rng=rng) for _ in range(cameras))


def perturbed_calibration(camera: CaptureCamera, faults: FaultConfig, rng: np.random.Generator) -> CaptureCamera:
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
