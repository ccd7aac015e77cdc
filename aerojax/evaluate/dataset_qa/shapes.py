"""Shapes of identities as point sets on their surfaces, and numbers of them that no rotation or scaling changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

QUANTILES = 64
PAIRS = 40_000
"""Distances drawn for a shape distribution: its quantiles are then certain to about half a percent."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points that ride on a mesh: the triangle of each and its barycentric weights."""

    face: Int[np.ndarray, "point"]
    weight: Float[np.ndarray, "point 3"]

    def at(self, vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> np.ndarray:
        """Where the points are (point, 3) on the posed mesh, in the vertices' unit."""
        return np.einsum("pc,pcx->px", self.weight, vertices[faces[self.face]])


def face_areas(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> np.ndarray:
    """Area of every triangle, in the square of the vertices' unit."""
    a, b, c = np.moveaxis(vertices[faces].astype(np.float64), 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def draw_surface_points(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], count: int, rng: np.random.Generator
) -> SurfacePoints:
    """Points uniform over the area of a mesh (Osada et al. 2002, Eq. 1); at least one triangle must have an area."""
    share = face_areas(vertices, faces)
    face = rng.choice(len(faces), count, p=share / share.sum())
    root, along = np.sqrt(rng.uniform(size=count)), rng.uniform(size=count)
    return SurfacePoints(face, np.stack([1 - root, root * (1 - along), root * along], axis=1))


def shape_distribution(
    points: Float[np.ndarray, "point 3"], rng: np.random.Generator, pairs: int = PAIRS
) -> Float[np.ndarray, "quantile"]:
    """Quantiles of the distance between two random surface points over its mean: D2 of Osada et al. (2002).

    The root mean square difference of two such vectors is the Wasserstein-2 distance of the distributions.
    """
    first, second = rng.integers(len(points), size=(2, pairs))
    distance = np.linalg.norm(points[first] - points[second], axis=1)
    return np.quantile(distance / distance.mean(), (np.arange(QUANTILES) + 0.5) / QUANTILES)


def shape_embedding(
    points: Float[np.ndarray, "time point 3"], area: float, rng: np.random.Generator, pairs: int = PAIRS
) -> Float[np.ndarray, "feature"]:
    """Numbers of an animated shape whose Euclidean distance says how unlike two shapes are.

    The mean over times of `shape_distribution`, two ratios of principal extents, and the surface's area beside the
    square of the largest extent; all the same after rotation, reflection and scaling.

    Args:
        points: on the surface, at some times of the animation.
        area: of the surface, in the square of the points' unit.
        rng: draws the pairs of points.
        pairs: distances drawn at each time.
    """
    distances = np.mean([shape_distribution(cloud, rng, pairs) for cloud in points], axis=0)
    extents = np.mean([np.sqrt(np.linalg.eigvalsh(np.cov(cloud.T)).clip(0.0))[::-1] for cloud in points], axis=0)
    largest = max(float(extents[0]), 1e-12)
    ratios = np.array([extents[1], extents[2]]) / largest
    # An eighth of the logarithm has the spread of the other numbers over the identities of the catalogue.
    return np.concatenate([distances / np.sqrt(QUANTILES), ratios, [np.log(max(area, 1e-12) / largest**2) / 8.0]])
