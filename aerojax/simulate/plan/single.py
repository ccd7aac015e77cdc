"""Sequences of one identity before a randomly drawn rig: for training clips and samples."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.simulate.assets.catalogue import Identity, build_identity
from aerojax.simulate.record import Actor, ScenePlan, record_scene
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.render.scene import Dome
from aerojax.simulate.world.flight import Flight, Motion, draw_flight
from aerojax.simulate.world.rigs import RigConfig, draw_rig
from kernels.rays.raytrace import Lighting


@dataclass(frozen=True)
class SequenceConfig:
    """One simulated sequence.

    rigs: cameras; each sequence draws one of them.
    frames, fps: length and rate.
    motion: `flight`, or `in_place` as in the published Sim-1.
    max_travel: metres that a flight may span.
    samples: rays along each side of a pixel.
    depth: write depth maps.
    white_dome: a white background; otherwise one drawn sky colour a camera.
    """

    rigs: tuple[RigConfig, ...] = (RigConfig(),)
    frames: int = 24
    fps: float = 30.0
    motion: Motion = "flight"
    max_travel: float = 4.0
    samples: int = 3
    depth: bool = True
    white_dome: bool = True


def sequence_seed(dataset_seed: int, name: str) -> int:
    """A sequence's own seed, independent of order and workers: the first 8 bytes of BLAKE2(seed, name)."""
    digest = hashlib.blake2b(f"{dataset_seed}/{name}".encode(), digest_size=8).digest()
    return int.from_bytes(digest, "little")


@dataclass(frozen=True)
class SequencePlan:
    """Everything that a sequence's seed decides, before anything is rendered.

    origin: where the middle of the flight lies, metres, world.
    flight: poses about the origin.
    cameras: static.
    lighting, domes: linear light, and the sRGB background of each camera.
    phase: where in its cycle the asset's animation starts, seconds.
    """

    origin: Float[np.ndarray, "3"]
    flight: Flight
    cameras: tuple[CaptureCamera, ...]
    lighting: Lighting
    domes: tuple[tuple[float, float, float], ...]
    phase: float


def draw_sequence(label: str, config: SequenceConfig, *, seed: int) -> SequencePlan:
    """Draw flight, rig, light and phase of a sequence of class `label`; the same seed gives the same plan."""
    rng = np.random.default_rng(seed)
    origin = np.array([*rng.uniform(-2.0, 2.0, 2), rng.uniform(6.0, 14.0)])
    flight = draw_flight(
        label, frames=config.frames, fps=config.fps, motion=config.motion, rng=rng, max_travel=config.max_travel
    )
    cameras = draw_rig(config.rigs[rng.integers(len(config.rigs))], origin, rng)
    if not config.depth:
        cameras = tuple(replace(c, depth=None) for c in cameras)
    lighting, skies = draw_dome_light(rng), draw_skies(len(cameras), rng)
    domes = ((1.0, 1.0, 1.0),) * len(cameras) if config.white_dome else skies
    return SequencePlan(origin, flight, cameras, lighting, domes, phase=rng.uniform(0.0, 10.0))


def simulate_sequence(identity: Identity, config: SequenceConfig, *, seed: int, folder: Path, assets: Path) -> Capture:
    """Fly one identity past a rig and write the capture.

    Args:
        identity: what flies; its stage is built in `assets` if it is not there.
        config: rig, motion and images.
        seed: decides everything; the same seed gives the same bytes.
        folder: becomes the capture; `scene.usda` in it is the sequence's stage.
        assets: folder of identity stages, shared by sequences.
    """
    plan = draw_sequence(identity.label, config, seed=seed)
    flight = Flight(plan.flight.position + plan.origin, plan.flight.world_from_body)
    actor = Actor(identity, build_identity(identity, assets), flight, plan.phase)
    domes = {camera.name: dome for camera, dome in zip(plan.cameras, plan.domes, strict=True)}
    images = ImageConfig(samples=config.samples, depth=config.depth, coverage=False)
    environment = Dome(light=plan.lighting, by_camera=domes)
    scene = ScenePlan((actor,), plan.cameras, plan.cameras, environment, images, config.frames, config.fps)
    return record_scene(scene, folder)[0]


def draw_dome_light(rng: np.random.Generator) -> Lighting:
    """Sun and sky before a dome, in every direction and of every strength that a fair day has."""
    azimuth, elevation = rng.uniform(0, 2 * np.pi), np.deg2rad(rng.uniform(20, 80))
    flat = np.cos(elevation)
    sun = (float(flat * np.cos(azimuth)), float(flat * np.sin(azimuth)), float(np.sin(elevation)))
    return Lighting(sun, sun=rng.uniform(0.2, 0.7), sky=rng.uniform(0.35, 0.7), ground=rng.uniform(0.1, 0.4))


def draw_skies(cameras: int, rng: np.random.Generator) -> tuple[tuple[float, float, float], ...]:
    """One sky colour a camera, sRGB."""
    skies = rng.uniform([0.45, 0.55, 0.65], [0.85, 0.9, 1.0], (cameras, 3))
    return tuple((s[0], s[1], s[2]) for s in skies.tolist())
