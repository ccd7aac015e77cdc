"""Ground-truth Gaussians: points that stay with the surface of an animated mesh, each in the shape of its share of it.

A share of area a that is a disc has the variance a / 4π along each of its two directions (∫r³dr / 2∫r dr = R²/4);
across it a Gaussian is as thin as the configuration says. Colours are those of the material, without any light.
"""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Float32, Int
from scipy.spatial.transform import Rotation

from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from aerojax.core.config import require_at_least
from aerojax.core.seeds import seed_of
from aerojax.core.types import SH_C0, Gaussians
from aerojax.simulate.usd.animated_mesh import AnimatedMesh

_R2 = (0.7548776662466927, 0.5698402909980532)
"""1/g and 1/g² with g³ = g + 1: steps of the additive sequence that fills a square evenly (Roberts 2018)."""


@dataclass(frozen=True)
class SurfaceConfig:
    """Gaussians on the surface of every object in every frame, as an annotation.

    count: of one object; 0 writes none.
    thickness: standard deviation across the surface over that along it.
    seed: of the points.
    """

    count: int = 0
    thickness: float = 0.1
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what has no covariance."""
        require_at_least(self, "count", "seed", least=0)
        require_at_least(self, "thickness", least=1e-3)


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points of a mesh by face, so that they move with it.

    face: index. barycentric: weights of the face's corners.
    share: of the face's area that the point stands for.
    colour: sRGB, 0..1.
    """

    face: Int[np.ndarray, "gaussian"]
    barycentric: Float[np.ndarray, "gaussian 3"]
    share: Float[np.ndarray, "gaussian"]
    colour: Float[np.ndarray, "gaussian 3"]


@dataclass(frozen=True, eq=False)
class SurfaceGaussians:
    """Gaussians of one pose.

    columns: the attributes of `Gaussians.columns`; the last axis of each is the normal's.
    normal: unit, outwards.
    """

    columns: Float32[np.ndarray, "gaussian 14"]
    normal: Float32[np.ndarray, "gaussian 3"]

    def gaussians(self) -> Gaussians:
        """For rendering and files."""
        return Gaussians.from_columns(jnp.asarray(self.columns))


def draw_surface_points(mesh: AnimatedMesh, count: int, seed: int) -> SurfacePoints:
    """Points evenly over the surface of a mesh in its pose at time 0, each with an equal share of the area.

    Faces take turns in equal steps of area (systematic sampling), so that a face has its share of points to within one;
    points of one face fill it evenly. Parts that lie inside of others are part of the surface.

    Args:
        mesh: an asset.
        count: of the points; at least one.
        seed: equal seeds give equal points.
    """
    rng = np.random.default_rng(seed_of("aerojax", "surface", seed))
    area = _areas(mesh.vertices_at(0.0).astype(np.float64), mesh.faces)[1]
    ends, each = np.cumsum(area), area.sum() / count
    face = np.searchsorted(ends, (np.arange(count) + rng.random()) * each, side="right").clip(max=len(area) - 1)
    u, v = ((np.arange(count) * step + rng.random()) % 1.0 for step in _R2)
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    barycentric = np.stack([1.0 - u - v, u, v], axis=1)
    return SurfacePoints(face, barycentric, each / area[face], _colours(mesh, face, barycentric))


def surface_gaussians(
    vertices: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
    points: SurfacePoints,
    *,
    thickness: float = SurfaceConfig.thickness,
) -> SurfaceGaussians:
    """The Gaussians of points of a posed mesh.

    Args:
        vertices: metres, in the frame that the Gaussians are to have.
        faces: of the mesh.
        points: from `draw_surface_points`.
        thickness: as in `SurfaceConfig`.
    """
    normal, area = _areas(vertices.astype(np.float64), faces[points.face])
    corners = vertices[faces[points.face]].astype(np.float64)
    mean = np.einsum("gc,gcd->gd", points.barycentric, corners)
    along = np.sqrt(points.share * area / (4.0 * np.pi))
    scale = along[:, None] * np.array([1.0, 1.0, thickness])
    edge = corners[:, 1] - corners[:, 0]
    first = edge / np.linalg.norm(edge, axis=1, keepdims=True).clip(1e-20)
    flat = area > 0  # what hides itself has its faces in one point
    axes = np.where(flat[:, None, None], np.stack([first, np.cross(normal, first), normal], axis=2), np.eye(3))
    quaternion = Rotation.from_matrix(axes).as_quat(canonical=True, scalar_first=True)
    opacity, colour = flat[:, None].astype(np.float64), (points.colour - 0.5) / SH_C0
    columns = np.concatenate([mean, quaternion, scale, opacity, colour], axis=1)
    return SurfaceGaussians(columns.astype(np.float32), normal.astype(np.float32))


def _areas(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]
) -> tuple[Float[np.ndarray, "face 3"], Float[np.ndarray, "face"]]:
    """Unit normals (zero where there is no area) and areas of faces."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    double = np.cross(b - a, c - a)
    length = np.linalg.norm(double, axis=1)
    return double / length[:, None].clip(1e-20), length / 2.0


def _colours(
    mesh: AnimatedMesh, face: Int[np.ndarray, "gaussian"], barycentric: Float[np.ndarray, "gaussian 3"]
) -> Float[np.ndarray, "gaussian 3"]:
    """sRGB of points: the face's colour times the nearest texel, in linear light."""
    linear = linear_from_srgb(mesh.albedo[face].astype(np.float64))
    place = np.einsum("gc,gcd->gd", barycentric, mesh.uv[face].astype(np.float64)) % 1.0
    for number, picture in enumerate(mesh.textures):
        mine = np.flatnonzero(mesh.texture[face] == number)
        height, width = picture.shape[:2]
        column = (place[mine, 0] * width).astype(int).clip(max=width - 1)
        row = ((1.0 - place[mine, 1]) * height).astype(int).clip(max=height - 1)
        linear[mine] *= linear_from_srgb(picture[row, column] / 255.0)
    return srgb_from_linear(linear)
