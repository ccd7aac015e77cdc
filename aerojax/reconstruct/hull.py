"""Reconstruction without learning: the visual hull of the masks, as Gaussians on its surface.

Laurentini 1994's visual hull on a grid, but with signed distances to the silhouettes instead of inside/outside votes,
so that the surface is found between grid points. It is the floor that a learned reconstructor must beat.

Everything works in the frame that the cameras are given in. The pipeline gives them in a frame fixed to the rig,
hence the grid, and with it the answer, turns with the world.
"""

from __future__ import annotations

import functools
import itertools
import operator
from dataclasses import dataclass
from typing import ClassVar, Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from aerojax.core.arrays import AnyArray, namespace
from aerojax.core.config import require_at_least
from aerojax.core.types import SH_C0, Camera, Gaussians, View, pytree_dataclass, static_field
from aerojax.geometry.cameras import pixels_of_camera_points
from aerojax.geometry.rotations import normalise, quaternion_from_rotation
from aerojax.reconstruct.base import ReconstructorConfig
from aerojax.reconstruct.silhouette import bilinear, known_about, known_at, signed_distance
from kernels.hull.limits import ENOUGH, LEAST_VIEWS


@dataclass(frozen=True)
class HullConfig(ReconstructorConfig):
    """Resolution of the hull.

    grid: cells along each side of the cube about the object.
    capacity: Gaussians kept at most; a larger surface is thinned evenly.
    extent: side of the cube over the largest width that a crop window has at the object.
    dilation: cells by which the hull is grown, so that rotor blades and rods of a pixel's width, whose silhouettes
        never meet exactly, survive.
    opacity: of every Gaussian.
    """

    reads_known: ClassVar[bool] = True
    name: Literal["hull"] = "hull"
    grid: int = 64
    capacity: int = 4096
    extent: float = 1.1
    dilation: float = 0.35
    opacity: float = 0.95

    def __post_init__(self) -> None:
        """Refuse what holds no hull.

        Raises:
            UserError: names the field and the least that works.
        """
        require_at_least(self, "grid", least=2)
        require_at_least(self, "capacity")
        require_at_least(self, "extent", least=0.1)
        require_at_least(self, "dilation", "opacity", least=0)

    def build(self) -> Hull:
        """The member."""
        return Hull(self)


@pytree_dataclass
class Hull:
    """The member of the door: `visual_hull` without the cell size. A pytree without leaves."""

    config: HullConfig = static_field()

    def __call__(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, Int[Array, ""]]:
        """See `Reconstructor`."""
        return visual_hull(views, valid, config=self.config)[:2]


def visual_hull(
    views: View, valid: Bool[Array, "view"], *, config: HullConfig
) -> tuple[Gaussians, Int[Array, ""], Float[Array, ""]]:
    """Surface Gaussians of the visual hull of crops that look at the frame's origin.

    A view cuts nothing away, and gives no colour, where its image does not reach (`View.known`); what fewer than two
    views see is not kept.

    Args:
        views: crops (leading axis `view`) whose cameras stand in a frame with the object near its origin, metres.
        valid: views that count; the others constrain nothing.
        config: resolution.

    Returns:
        Gaussians, `config.capacity` of them, of which the first `count` are real and the rest repeat the first;
        `count` (0 where the masks meet nowhere); the grid's cell size, metres.
    """
    distance = jax.vmap(signed_distance)(views.mask, views.known)
    cell = _cell_size(views.camera, valid, config)
    field = _hull_field(Outlines(distance, views.known, views.camera, valid), cell, config.grid)
    field = field + config.dilation * cell
    points, normals, count = _surface(field, cell, config)
    quaternion, scale = _surface_axes(points, normals, field, cell, config.grid)
    # The grown surface lies just off the object: its colour is that of the surface beneath.
    beneath = points - config.dilation * cell * normals
    colour = _surface_colour(views, distance, valid, beneath, normals, cell)
    opacity = jnp.full(points.shape[0], config.opacity, points.dtype)
    sh = ((colour - 0.5) / SH_C0)[:, None, :]
    return Gaussians(points, quaternion, scale, opacity, sh), count, cell


@pytree_dataclass
class Outlines:
    """What cuts the hull.

    distance: to each silhouette, pixels, positive inside. known: as in `View`. camera: of the crops.
    valid: views that count.
    """

    distance: Float[Array, "*batch size size"]
    known: Bool[Array, "*batch size size"] | None
    camera: Camera
    valid: Bool[Array, "*batch"]


def _cell_size(cameras: Camera, valid: Bool[Array, "view"], config: HullConfig) -> Float[Array, ""]:
    """The cube's side follows the widest crop window at the origin's depth."""
    depth = jnp.linalg.norm(cameras.world_from_cam[:, :3, 3], axis=-1)
    width = depth * cameras.width / cameras.K[:, 0, 0]
    return config.extent * jnp.max(jnp.where(valid, width, 0.0)) / config.grid


def _cell_centres(index: Int[Array, "cell"], cell: Float[Array, ""], grid: int) -> Float[Array, "cell 3"]:
    ijk = jnp.stack(jnp.unravel_index(index, (grid, grid, grid)), axis=-1)
    return (ijk.astype(cell.dtype) - (grid - 1) / 2) * cell


def _pixels_and_depths(
    points: Float[Array, "point 3"], camera: Camera
) -> tuple[Float[Array, "point 2"], Float[Array, "point"]]:
    """Crop pixels and depths; depth is kept positive."""
    m = cam_from_world_rows(camera.world_from_cam)
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    # Element by element: products with a 3×3 matrix take XLA's CPU code as long as all the rest of the hull.
    across, down, depth = (m[row, 0] * x + m[row, 1] * y + m[row, 2] * z + m[row, 3] for row in range(3))
    inside = jnp.stack([across, down, jnp.maximum(depth, 1e-3)], axis=-1)
    return pixels_of_camera_points(inside, camera), inside[:, 2]


def cam_from_world_rows(world_from_cam: Float[AnyArray, "*batch 4 4"]) -> Float[AnyArray, "*batch 3 4"]:
    """First three rows [Rᵀ | -Rᵀc] of the inverse of rigid transforms [R c; 0 1], NumPy or JAX.

    The cameras look at the origin from afar, hence Rᵀp - Rᵀc keeps more digits than Rᵀ(p - c). In float32, factors are
    split into halves of 12 bits: their products are exact, so fused multiply-adds change nothing and NumPy, XLA and any
    device agree on the bits.
    """
    xp = namespace(world_from_cam)
    turned = xp.swapaxes(world_from_cam[..., :3, :3], -1, -2)
    centre = xp.broadcast_to(world_from_cam[..., None, :3, 3], turned.shape)
    (a, b), (c, d) = _halves(turned), _halves(centre)
    terms = [(x * y)[..., axis] for x, y in ((b, d), (a, d), (b, c), (a, c)) for axis in range(3)]
    shift = -functools.reduce(operator.add, terms)
    return xp.concatenate([turned, shift[..., None]], axis=-1)


def _halves(values: Float[AnyArray, "*shape"]) -> tuple[Float[AnyArray, "*shape"], Float[AnyArray, "*shape"]]:
    """float32 as the sum of two numbers of 12 significant bits each."""
    xp = namespace(values)
    high = (values.view(xp.int32) & -4096).view(xp.float32)
    return high, values - high


def _hull_field(outlines: Outlines, cell: Float[Array, ""], grid: int) -> Float[Array, "grid grid grid"]:
    """Approximate signed distance to the hull, metres, positive inside: the least over views of the silhouettes'.

    Evaluated on every other grid point of each axis first; the distance changes no faster than one metre a metre, so
    only cells whose coarse neighbour is near the surface are evaluated again, and the others keep the coarse value.
    """
    half = grid // 2
    coarse_cell = 2 * cell
    enough = ENOUGH * cell
    coarse = _least_distance(_cell_centres(jnp.arange(half**3), coarse_cell, half), outlines, enough)
    # 0.87 cells to the surface, one more for the gradient's stencil, and the way to the coarse centre.
    near = jnp.abs(coarse) < 1.45 * coarse_cell
    budget = half**3 // 4
    chosen = jnp.nonzero(near, size=budget, fill_value=half**3)[0]
    corner = 2 * jnp.stack(jnp.unravel_index(jnp.minimum(chosen, half**3 - 1), (half, half, half)), axis=-1)
    ijk = (corner[:, None, :] + jnp.array(list(itertools.product((0, 1), repeat=3)))[None]).reshape(-1, 3)
    fine = _least_distance((ijk.astype(cell.dtype) - (grid - 1) / 2) * cell, outlines, enough)
    field = jnp.repeat(jnp.repeat(jnp.repeat(coarse.reshape(half, half, half), 2, 0), 2, 1), 2, 2)
    at = jnp.where(jnp.repeat(chosen < half**3, 8)[:, None], ijk, grid)
    return field.at[at[:, 0], at[:, 1], at[:, 2]].set(fine, mode="drop")


def _least_distance(
    points: Float[Array, "point 3"], outlines: Outlines, enough: Float[Array, ""]
) -> Float[Array, "point"]:
    """Least over the views that see a point; where some pixels are not known, no less than `enough`.

    At an image's border the distance jumps: cut off, it is the same however many views are asked.
    """

    def body(found: tuple[Array, Array], view: Outlines) -> tuple[tuple[Array, Array], None]:
        least, views = found
        pixels, depth = _pixels_and_depths(points, view.camera)
        metres = bilinear(view.distance, pixels) * depth / view.camera.K[0, 0]
        use = view.valid if view.known is None else view.valid & known_at(view.known, pixels)
        return (jnp.minimum(least, jnp.where(use, metres, jnp.inf)), views + use.astype(jnp.int32)), None

    none = jnp.zeros((), jnp.int32) if outlines.known is None else jnp.zeros(points.shape[0], jnp.int32)
    start = jnp.full(points.shape[0], jnp.inf, outlines.distance.dtype), none
    least, views = jax.lax.scan(body, start, outlines)[0]
    return least if outlines.known is None else jnp.where(views < LEAST_VIEWS, enough, jnp.maximum(least, enough))


def _gradient(field: Float[Array, "grid grid grid"], cell: Float[Array, ""]) -> Float[Array, "grid grid grid 3"]:
    return jnp.stack(jnp.gradient(field), axis=-1) / cell


def _surface(
    field: Float[Array, "grid grid grid"], cell: Float[Array, ""], config: HullConfig
) -> tuple[Float[Array, "gaussian 3"], Float[Array, "gaussian 3"], Int[Array, ""]]:
    """Points where the field is zero, one from each cell that the surface comes near, and outward normals.

    One Newton step along the gradient takes a cell's centre to the surface. Cells within 0.87 cells (half a cell's
    diagonal) count, also those just outside, so that sheets and rods thinner than a cell are kept.
    """
    gradient = _gradient(field, cell).reshape(-1, 3)
    value = field.reshape(-1)
    steep = jnp.sum(gradient * gradient, axis=-1)
    near = (jnp.abs(value) < 0.87 * cell * jnp.sqrt(steep)) & (steep > 0.01) & (jnp.abs(value) < 0.87 * cell)
    # The faces of the largest cube that fits the crop windows have 6 grid² cells within 0.87 cells of them.
    most = 8 * config.grid**2
    total = jnp.minimum(jnp.sum(near), most)
    everything = jnp.nonzero(near, size=most, fill_value=0)[0]
    count = jnp.minimum(total, config.capacity)
    rank = jnp.arange(config.capacity)
    # Even thinning by rank where the surface has more cells than the capacity; padding repeats the first.
    stride = total.astype(cell.dtype) / config.capacity
    picked = jnp.where(total > config.capacity, (rank.astype(cell.dtype) * stride).astype(jnp.int32), rank)
    index = everything[jnp.where(rank < count, picked, 0)]
    step = value[index] / jnp.maximum(steep[index], 0.01)
    points = _cell_centres(index, cell, config.grid) - step[:, None] * gradient[index]
    return points, -normalise(gradient[index]), count


def _surface_axes(
    points: Float[Array, "gaussian 3"],
    normals: Float[Array, "gaussian 3"],
    field: Float[Array, "grid grid grid"],
    cell: Float[Array, ""],
    grid: int,
) -> tuple[Float[Array, "gaussian 4"], Float[Array, "gaussian 3"]]:
    """Axes and standard deviations from the second moments of the surface within one cell of each point.

    The moments weigh the 3×3×3 grid points about the Gaussian by how near the surface is, so a rod gives one long axis,
    an edge or sheet two. The normal is one axis; the other two diagonalise the moments in the tangent plane, in closed
    form, which is exact and has no degenerate branch.
    """
    offset = jnp.stack(jnp.meshgrid(*([jnp.arange(-1, 2)] * 3), indexing="ij"), axis=-1).reshape(-1, 3)
    base = jnp.round(points / cell + (grid - 1) / 2).astype(jnp.int32)
    ijk = jnp.clip(base[:, None, :] + offset[None], 0, grid - 1)
    near = jnp.exp(-2.0 * (field[ijk[..., 0], ijk[..., 1], ijk[..., 2]] / cell) ** 2)
    delta = (ijk.astype(cell.dtype) - (grid - 1) / 2) * cell - points[:, None, :]
    weight = near * jnp.exp(-jnp.sum(delta * delta, axis=-1) / (2 * cell * cell))
    weight = weight / jnp.maximum(jnp.sum(weight, axis=-1, keepdims=True), 1e-6)
    moments = jnp.einsum("gn,gni,gnj->gij", weight, delta, delta)
    return _frame_from_moments(moments, normals, cell)


def _frame_from_moments(
    moments: Float[Array, "gaussian 3 3"], normals: Float[Array, "gaussian 3"], cell: Float[Array, ""]
) -> tuple[Float[Array, "gaussian 4"], Float[Array, "gaussian 3"]]:
    """Principal axes with the third one along the normal; 0.15 cells are the thinnest standard deviation."""
    axes = jnp.eye(3, dtype=normals.dtype)
    helper = jnp.where(jnp.abs(normals[:, :1]) < 0.6, axes[None, 0], axes[None, 1])
    first = normalise(jnp.cross(normals, helper))
    second = jnp.cross(normals, first)
    plane = jnp.stack([first, second], axis=-2)
    block = plane @ moments @ jnp.swapaxes(plane, -1, -2)
    a, b, c = block[:, 0, 0], block[:, 0, 1], block[:, 1, 1]
    angle = 0.5 * jnp.arctan2(2 * b, a - c + 1e-30)
    cos, sin = jnp.cos(angle)[:, None], jnp.sin(angle)[:, None]
    major, minor = cos * first + sin * second, -sin * first + cos * second
    rotation = jnp.stack([major, minor, jnp.cross(major, minor)], axis=-1)
    variance = jnp.einsum("gik,gij,gjk->gk", rotation, moments, rotation)
    scale = jnp.sqrt(jnp.maximum(variance * jnp.array([[1.0, 1.0, 0.1]], variance.dtype), (0.15 * cell) ** 2))
    return quaternion_from_rotation(rotation), scale


def _surface_colour(
    views: View,
    distance: Float[Array, "view size size"],
    valid: Bool[Array, "view"],
    points: Float[Array, "gaussian 3"],
    normals: Float[Array, "gaussian 3"],
    cell: Float[Array, ""],
) -> Float[Array, "gaussian 3"]:
    """Mean colour over the views that see a point, weighted by how squarely, away from the silhouette's rim."""

    def one_view(view: View, image: Array, use: Array) -> tuple[Array, Array]:
        pixels, depth = _pixels_and_depths(points, view.camera)
        bins = view.camera.width // 2
        where = jnp.clip((pixels / 2).astype(jnp.int32), 0, bins - 1)
        flat = where[:, 1] * bins + where[:, 0]
        nearest = jnp.full(bins * bins, jnp.inf).at[flat].min(depth)
        seen = depth < nearest[flat] + 2.0 * cell
        towards = normalise(view.camera.world_from_cam[None, :3, 3] - points)
        square = jnp.maximum(jnp.sum(normals * towards, axis=-1), 0.0) ** 2
        inner = jnp.clip(bilinear(image, pixels) / 2.0, 0.0, 1.0)  # the rim mixes with the background
        use = use if view.known is None else use & known_about(view.known, pixels)
        weight = jnp.where(use, 1e-6 + seen.astype(inner.dtype) * (1e-3 + square * inner), 0.0)
        return weight[:, None] * bilinear(view.rgb, pixels), weight

    colours, weights = jax.vmap(one_view)(views, distance, valid)
    return jnp.sum(colours, axis=0) / jnp.maximum(jnp.sum(weights, axis=0), 1e-12)[:, None]
