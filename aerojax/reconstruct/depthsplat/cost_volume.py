"""The plane sweep: how well each cell's features agree with the other views' at every candidate depth."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from aerojax.core.types import Camera, pytree_dataclass
from aerojax.geometry.cameras import pixels_of_camera_points
from aerojax.geometry.resampling import sample_bilinear
from aerojax.reconstruct.depthsplat.config import CELL, DepthSplatSizes
from aerojax.reconstruct.depthsplat.layers import at_least_float32
from aerojax.reconstruct.depthsplat.transformer import Neighbours

NEAREST = 1e-3
"""Metres before a camera that a projected point has at least."""
THESIS_DISTANCE = 1.5
"""Metres from the cameras to the object for which `near`, `far` and the scales' bounds are given (thesis §5.5.1)."""
THESIS_HALF_WIDTH = THESIS_DISTANCE * math.tan(math.radians(25))
"""Half the width, at that distance, of what a field of view of 50° shows."""


@pytree_dataclass
class DepthRange:
    """Between which depths each view is swept.

    near, far: metres along the optical axis.
    unit: metres that are one metre of the thesis' arrangement, in which sizes are configured.
    """

    near: Float[Array, "view"]
    far: Float[Array, "view"]
    unit: Float[Array, ""]

    def inverse_depth(self, place: Float[Array, "view *cell"]) -> Float[Array, "view *cell"]:
        """1/metre at places in the range: 0 is far, 1 is near."""
        low, high = ((1 / limit).reshape(limit.shape + (1,) * (place.ndim - 1)) for limit in (self.far, self.near))
        return low + place * (high - low)


def depth_range(cameras: Camera, valid: Bool[Array, "view"], config: DepthSplatSizes) -> DepthRange:
    """The range of cameras that look at the frame's origin; see `DepthSplatSizes.bins`."""
    distance = jnp.linalg.norm(cameras.world_from_cam[:, :3, 3], axis=-1)
    if config.bins == "global":
        weight = valid.astype(distance.dtype)
        mean = jnp.sum(distance * weight) / jnp.maximum(jnp.sum(weight), 1.0)
        unit = jnp.where(valid.any(), mean, THESIS_DISTANCE) / THESIS_DISTANCE
        wide = jnp.ones_like(distance)
        return DepthRange(wide * config.near * unit, wide * config.far * unit, unit)
    half_width = distance * (cameras.width / 2) / cameras.K[:, 0, 0]
    widest = jnp.max(jnp.where(valid, half_width, 0.0))
    unit = jnp.where(valid.any(), widest, THESIS_HALF_WIDTH) / THESIS_HALF_WIDTH
    before, behind = THESIS_DISTANCE - config.near, config.far - THESIS_DISTANCE
    # A camera may stand inside the range: what is nearer than a tenth of its distance cannot be seen whole.
    near = jnp.maximum(distance - before * unit, 0.1 * distance)
    return DepthRange(near, distance + behind * unit, unit)


def feature_cameras(cameras: Camera, *, compat: bool) -> Camera:
    """Cameras in units of cells, cell i at coordinate i.

    Cells have their centres on every fourth pixel, that is at 4i + ½; upstream takes 4i.
    """
    half = 0.0 if compat else 0.5
    scaled = cameras.K[:, :2] / CELL
    scaled = scaled.at[:, :, 2].add(-half / CELL)
    K = jnp.concatenate([scaled, cameras.K[:, 2:]], axis=1)
    return Camera(K, cameras.world_from_cam, cameras.width // CELL, cameras.height // CELL)


@pytree_dataclass
class PlaneSweep:
    """Agreement of each cell with the other views at every candidate depth.

    cost: ⟨f, f̃⟩/√channels, averaged over the other views.
    seen: how many of them show the point.
    """

    cost: Float[Array, "view height width candidate"]
    seen: Float[Array, "view height width candidate"]


def plane_sweep(
    features: Float[Array, "view height width channel"],
    cameras: Camera,
    neighbours: Neighbours,
    inverse_depth: Float[Array, "view candidate"],
    *,
    compat: bool,
) -> PlaneSweep:
    """Compare the features of every view with those of its neighbours where candidate depths put them.

    Args:
        features: cells at whole coordinates.
        cameras: in units of cells, see `feature_cameras`; each has its own K.
        neighbours: of each view.
        inverse_depth: candidates of each view, 1/metre.
        compat: the mean is over all neighbours, whether they show the point or not, and it is projected with the
            reference view's K; else over those that show it, 0 where none does.
    """
    features = at_least_float32(features)
    points = _rays(cameras, features.shape[1], features.shape[2])
    relative = _relative_poses(cameras, neighbours)
    target, others = cameras.K[neighbours.index], features[neighbours.index]
    if compat:
        target = jnp.broadcast_to(cameras.K[:, None], target.shape)
    counts = neighbours.counts.astype(features.dtype)

    @jax.checkpoint
    def at(carry: None, inverse: Float[Array, "view"]) -> tuple[None, tuple[Array, Array]]:
        match = jax.vmap(jax.vmap(_match, (None, None, 0, 0, 0)), (0, 0, 0, 0, 0))
        cost, seen = match(features, points / inverse[:, None, None], relative, target, others)
        seen = seen * counts[:, :, None]
        weight = counts[:, :, None] if compat else seen
        total = jnp.sum(jnp.broadcast_to(weight, seen.shape), axis=1)
        return carry, (jnp.sum(cost * weight, axis=1) / jnp.maximum(total, 1.0), seen.sum(axis=1))

    cost, seen = jax.lax.scan(at, None, inverse_depth.T)[1]
    shape = features.shape[:3]
    cost, seen = (jnp.moveaxis(values, 0, -1).reshape(*shape, -1) for values in (cost, seen))
    return PlaneSweep(cost, seen)


def _relative_poses(cameras: Camera, neighbours: Neighbours) -> Float[Array, "view other 3 4"]:
    """From each camera's frame to those of its neighbours.

    The difference of the centres comes first: they stand much further from the object than it is wide.
    """
    rotation, centre = cameras.world_from_cam[:, :3, :3], cameras.world_from_cam[:, :3, 3]
    other = rotation[neighbours.index]
    between = centre[:, None] - centre[neighbours.index]
    turned = jnp.einsum("voji,vjk->voik", other, rotation, precision="highest")
    shift = jnp.einsum("voji,voj->voi", other, between, precision="highest")
    return jnp.concatenate([turned, shift[..., None]], axis=-1)


def _rays(cameras: Camera, height: int, width: int) -> Float[Array, "view cell 3"]:
    """Points of each camera's own frame at depth 1 behind the cells."""
    rows, columns = jnp.mgrid[:height, :width].astype(cameras.K.dtype)
    cells = jnp.stack([columns.ravel(), rows.ravel(), jnp.ones(height * width, rows.dtype)], axis=-1)
    return jnp.einsum("vij,cj->vci", jnp.linalg.inv(cameras.K), cells, precision="highest")


# A compiled part of its own, so that `cost.operations` can tell it from the network's matrix products.
@jax.jit
def _match(
    reference: Float[Array, "height width channel"],
    points: Float[Array, "cell 3"],
    relative: Float[Array, "3 4"],
    K: Float[Array, "3 3"],
    target: Float[Array, "height width channel"],
) -> tuple[Float[Array, "cell"], Float[Array, "cell"]]:
    """Agreement with one other view at points of the reference camera's frame, and whether it shows them."""
    height, width, channels = target.shape
    moved = jnp.einsum("ij,cj->ci", relative[:, :3], points, precision="highest") + relative[None, :, 3]
    in_front = moved[:, 2] > NEAREST
    moved = moved.at[:, 2].set(jnp.maximum(moved[:, 2], NEAREST))
    where = pixels_of_camera_points(moved, _Intrinsics(K))
    limit = jnp.asarray([width - 1, height - 1], where.dtype)
    inside = jnp.all((where >= 0) & (where <= limit[None]), axis=-1) & in_front
    # No gradient through the geometry; what lies far beyond the border stays finite.
    where = jnp.clip(jax.lax.stop_gradient(where), -2.0, (limit + 2.0)[None])
    warped = sample_bilinear(target, where + 0.5)
    agreement = jnp.sum(reference.reshape(-1, channels) * warped, axis=-1) / math.sqrt(channels)
    return agreement, inside.astype(agreement.dtype)


@pytree_dataclass
class _Intrinsics:
    K: Float[Array, "3 3"]
