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
from aerojax.evaluate.dataset_qa.shapes import SurfacePoints, draw_surface_points, face_areas, shape_embedding
from aerojax.simulate.usd.animated_mesh import AnimatedMesh, load_animated_mesh
from kernels.sampling.farthest_points import farthest_points

_CANDIDATES = 2048  # points drawn by area, of which the farthest are taken
_POSES = 4  # times of the animation that an embedding is the mean of


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
    embedding, again = _embedding(mesh, rng), _embedding(mesh, rng)
    return ShapeResult(Embedded(job.entry, embedding, float(np.linalg.norm(embedding - again))), motion)


def _embedding(mesh: AnimatedMesh, rng: np.random.Generator) -> Float[np.ndarray, "feature"]:
    poses = [mesh.vertices_at(mesh.cycle_seconds * i / _POSES) for i in range(_POSES)]
    points = draw_surface_points(poses[0], mesh.faces, 4 * _CANDIDATES, rng)
    clouds = np.stack([points.at(pose, mesh.faces) for pose in poses]).astype(np.float64)
    return shape_embedding(clouds, float(face_areas(poses[0], mesh.faces).sum()), rng)
