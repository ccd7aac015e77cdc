"""Shapes of a data set's identities: points on their posed meshes, how they move, and what tells them apart."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from aerojax.core.seeds import seed_of
from aerojax.data.manifest import IdentityEntry
from aerojax.evaluate.dataset_qa.leakage import Embedded
from aerojax.evaluate.dataset_qa.motion import Motion, motion_of
from aerojax.evaluate.dataset_qa.shapes import PAIRS, SurfacePoints, draw_surface_points, face_areas, shape_embedding
from aerojax.simulate.usd.animated_mesh import AnimatedMesh, load_animated_mesh
from kernels.sampling.farthest_points import farthest_points

_CANDIDATES = 2048  # points drawn by area, of which the farthest are taken
_POSES = 48  # times of the animation that an embedding is the mean of
SAMPLINGS = 5
"""Of every individual: the largest distance of ten pairs is rarely below that of two samplings of one."""


@dataclass(frozen=True)
class ShapeJob:
    """One identity, and how its motion is sampled: frames, frames a second and points a frame."""

    entry: IdentityEntry
    frames: int
    fps: float
    points: int


@dataclass(frozen=True)
class ShapeResult:
    """What is known of an identity's shape."""

    embedded: Embedded
    motion: Motion


def describe_shape(job: ShapeJob) -> ShapeResult:
    """Pose an identity's mesh through its animation and measure it, in the body's frame.

    The farthest points are chosen on the first pose and then ride on the surface, so that what moves is the shape and
    not the sample.
    """
    mesh = load_animated_mesh(job.entry.asset)
    rng = np.random.default_rng(seed_of("surface points", job.entry.name))
    rest = mesh.vertices_at(0.0)
    candidates = draw_surface_points(rest, mesh.faces, _CANDIDATES, rng)
    first = jnp.asarray(candidates.at(rest, mesh.faces), jnp.float32)
    chosen = np.asarray(farthest_points(first, min(job.points, _CANDIDATES)))
    spread = SurfacePoints(candidates.face[chosen], candidates.weight[chosen])
    clouds = np.stack([spread.at(mesh.vertices_at(f / job.fps), mesh.faces) for f in range(job.frames)])
    motion = motion_of(job.entry.name, job.entry.label, clouds.astype(np.float64))
    return ShapeResult(Embedded(job.entry, samplings_of(mesh, rng)), motion)


def samplings_of(
    mesh: AnimatedMesh, rng: np.random.Generator, count: int = SAMPLINGS
) -> Float[np.ndarray, "sampling feature"]:
    """Embeddings of one individual, each from its own points on the surface and its own phase of the animation."""
    return np.stack([_embedding(mesh, rng) for _ in range(count)])


def _embedding(mesh: AnimatedMesh, rng: np.random.Generator) -> Float[np.ndarray, "feature"]:
    # A random time in each part of the cycle: at equal steps, wings and rotors would be met at few of their phases.
    phases = (np.arange(_POSES) + rng.uniform(size=_POSES)) / _POSES
    poses = [mesh.vertices_at(mesh.cycle_seconds * float(phase)) for phase in phases]
    points = draw_surface_points(mesh.vertices_at(0.0), mesh.faces, 4 * _CANDIDATES, rng)
    clouds = np.stack([points.at(pose, mesh.faces) for pose in poses]).astype(np.float64)
    area = float(np.mean([face_areas(pose, mesh.faces).sum() for pose in poses[::6]]))
    return shape_embedding(clouds, area, rng, pairs=PAIRS // 4)  # of each of many poses
