"""Sequences of the simulator, written as captures with full truth."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from aerojax.capture.format import Capture, CaptureCamera, ObjectState, TrackedObject, Truth, write_capture_json
from aerojax.capture.write import write_frame
from aerojax.geometry.boxes import tight_box
from aerojax.geometry.rotations import quaternion_from_rotation
from aerojax.simulate.assets.catalogue import Identity, build_identity
from aerojax.simulate.flight import Flight, Motion, draw_flight
from aerojax.simulate.render import Rendering, linear_from_srgb, render_object
from aerojax.simulate.rigs import RigConfig, draw_rig
from aerojax.simulate.scene import author_scene, body_poses
from aerojax.simulate.usd_scene import AnimatedMesh, load_animated_mesh
from kernels.raytrace import Lighting, MeshCaster


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
    lighting, domes = _draw_light(config, len(cameras), rng)
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
    asset = build_identity(identity, assets)
    folder.mkdir(parents=True, exist_ok=True)
    scene = folder / "scene.usda"
    author_scene(scene, asset, plan.flight, plan.cameras, fps=config.fps, origin=plan.origin)
    states = _render_frames(load_animated_mesh(asset), body_poses(scene), plan, config, folder)
    truth = Truth(
        (TrackedObject(1, identity.label, identity.name, tuple(states), source="aerojax", licence="Apache-2.0"),)
    )
    capture = Capture(folder, config.fps, config.frames, plan.cameras, truth)
    write_capture_json(capture)
    return capture


def _draw_light(
    config: SequenceConfig, cameras: int, rng: np.random.Generator
) -> tuple[Lighting, tuple[tuple[float, float, float], ...]]:
    azimuth, elevation = rng.uniform(0, 2 * np.pi), np.deg2rad(rng.uniform(20, 80))
    flat = np.cos(elevation)
    sun = (float(flat * np.cos(azimuth)), float(flat * np.sin(azimuth)), float(np.sin(elevation)))
    lighting = Lighting(sun, sun=rng.uniform(0.2, 0.7), sky=rng.uniform(0.35, 0.7), ground=rng.uniform(0.1, 0.4))
    skies = rng.uniform([0.45, 0.55, 0.65], [0.85, 0.9, 1.0], (cameras, 3))
    domes = ((1.0, 1.0, 1.0) if config.white_dome else (float(s[0]), float(s[1]), float(s[2])) for s in skies)
    return lighting, tuple(domes)


def _render_frames(
    mesh: AnimatedMesh, poses: np.ndarray, plan: SequencePlan, config: SequenceConfig, folder: Path
) -> list[ObjectState]:
    caster = MeshCaster(mesh.faces, linear_from_srgb(mesh.albedo), mesh.vertices_at(plan.phase))
    with jax.enable_x64(True):
        quaternions = np.asarray(quaternion_from_rotation(jnp.asarray(poses[:, :3, :3])))
    states = []
    for frame, pose in enumerate(poses):
        origin = pose[:3, 3]
        turned = mesh.vertices_at(plan.phase + frame / config.fps).astype(np.float64) @ pose[:3, :3].T
        caster.pose(turned)
        boxes: dict[str, tuple[float, float, float, float]] = {}
        for camera, dome in zip(plan.cameras, plan.domes, strict=True):
            image = render_object(
                caster, turned + origin, origin, camera, lighting=plan.lighting, samples=config.samples, dome=dome
            )
            _write(folder, camera, frame, image)
            box = tight_box(image.mask)
            if box is not None:
                boxes[camera.name] = box
        position, quaternion = tuple(origin.tolist()), tuple(quaternions[frame].tolist())
        states.append(ObjectState(frame, position, quaternion, boxes, {c.name: c.name in boxes for c in plan.cameras}))
    return states


def _write(folder: Path, camera: CaptureCamera, frame: int, image: Rendering) -> None:
    depth = image.depth if camera.depth is not None else None
    write_frame(folder, camera, frame, image.rgb, image.mask.astype(np.uint16), depth)
