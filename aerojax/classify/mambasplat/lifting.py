"""From the 14 columns of Gaussians to vector-neuron tokens: normalisation, equivariant vectors, invariant scalars."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.mambasplat.config import MambaSplatConfig, Mode, uses_colour, uses_opacity, uses_shape
from aerojax.classify.mambasplat.encoder import bias_epsilon, masked_mean, weight_init
from aerojax.classify.mambasplat.motion import MotionState, feature_count, features_after, median_distance, motion_state
from aerojax.classify.mambasplat.vector_neurons import VNLinear, draw_weight
from aerojax.core.arrays import pairwise_sum
from aerojax.core.types import pytree_dataclass
from aerojax.gaussians.merge import MergedGaussians
from aerojax.geometry.covariances import covariance_from_axes
from aerojax.geometry.rotations import rotation_from_quaternion

SMALLEST_RELATIVE_SCALE = 1e-4
"""Scales below this share of the object's radius count as this: a flat Gaussian's logarithm stays finite."""
SMALLEST_VARIANCE_SHARE = 1e-3
"""Added to a merged covariance in shares of its mean variance: rounding moves the logarithm of the determinant by no
more than 1e-7 / 1e-3."""
SMALLEST_MASS = 1e-3
"""Clusters with a smaller share of the mean cluster's mass count as this."""


@pytree_dataclass
class ScaleSums:
    """Sums over the valid tokens of all frames so far, from which the running radius follows.

    moment: squared distance from the frame's centre, weighted, square metres.
    weight: of the tokens.
    """

    moment: Float[Array, ""]
    weight: Float[Array, ""]


@pytree_dataclass
class Frames:
    """Frames about their centres, in units of their radius.

    columns: so changed; zero for padded tokens.
    extra: each frame's further invariants: log of the radius in metres (`metric_size`) and those of `motion`.
    centre: metres, as the sum of two parts: the rounded one, and what lacks to it.
    radius: metres.
    """

    columns: Float[Array, "time token 14"]
    extra: Float[Array, "time extra"]
    centre: Float[Array, "time 2 3"]
    radius: Float[Array, "time"]


def normalise_clip(
    columns: Float[Array, "time token 14"], mask: Bool[Array, "time token"], config: MambaSplatConfig
) -> Frames:
    """Centre each frame and divide positions and scales by a radius; padded tokens become zero.

    The centre is a frame's mean position and the radius the root of the mean squared distance from it, both weighted by
    opacity where the mode reads opacity (floaters are faint). `scale_normalisation` says over which frames the radius
    is taken: where they share one, growth and shrinkage remain visible.
    """
    nothing = jnp.zeros((), columns.dtype)
    motion = motion_state(columns.dtype) if feature_count(config) else None
    return normalise_after(ScaleSums(nothing, nothing), motion, columns, mask, config)[0]


def normalise_after(
    before: ScaleSums,
    motion: MotionState | None,
    columns: Float[Array, "time token 14"],
    mask: Bool[Array, "time token"],
    config: MambaSplatConfig,
) -> tuple[Frames, ScaleSums, MotionState | None]:
    """`normalise_clip` of frames that follow others, and what is remembered with these frames."""
    columns = jnp.where(mask[..., None], columns, 0.0)
    weights = mask.astype(columns.dtype)
    if uses_opacity(config.mode):
        weights = weights * jnp.maximum(columns[..., 10], 1e-6)
    total = weights.sum(axis=1)
    mass = jnp.maximum(total, 1e-9)[:, None]
    # The mean of what the first mean leaves: the sum of small numbers keeps the digits that the first one lost.
    centre = pairwise_sum(columns[..., :3] * weights[..., None], axis=1) / mass
    offset = columns[..., :3] - centre[:, None]
    beside = pairwise_sum(offset * weights[..., None], axis=1) / mass
    centred = jnp.where(mask[..., None], offset - beside[:, None], 0.0)
    centre = jnp.stack([centre, beside], axis=1)
    moment = pairwise_sum(jnp.sum(centred * centred, axis=-1) * weights, axis=1)
    so_far = before.moment + jnp.cumsum(moment), before.weight + jnp.cumsum(total)
    radius = _radius(centred, mask, (moment, total), so_far, config)
    extra = [jnp.log(radius)[:, None]] if config.metric_size else [jnp.zeros((len(radius), 0), radius.dtype)]
    inverse = 1 / radius[:, None, None]
    if motion is not None:
        found, motion = features_after(motion, centred * inverse, weights, centre, radius, config)
        extra.append(found)
    parts = (centred * inverse, columns[..., 3:7], columns[..., 7:10] * inverse, columns[..., 10:])
    scale = ScaleSums(so_far[0][-1], so_far[1][-1])
    frames = Frames(jnp.concatenate(parts, axis=-1), jnp.concatenate(extra, axis=1), centre, radius)
    return frames, scale, motion


def _radius(
    centred: Float[Array, "time token 3"],
    mask: Bool[Array, "time token"],
    frames: tuple[Float[Array, "time"], Float[Array, "time"]],
    so_far: tuple[Float[Array, "time"], Float[Array, "time"]],
    config: MambaSplatConfig,
) -> Float[Array, "time"]:
    """The length of `scale_normalisation`, metres, from each frame's sums of moment and weight and those so far."""
    moment, total = frames
    if config.scale_normalisation == "clip":
        return jnp.broadcast_to(_root_mean(moment.sum(), total.sum()), moment.shape)
    if config.scale_normalisation == "robust":
        distance = jnp.sqrt(jnp.sum(centred**2, axis=-1) + 1e-12)
        return jnp.broadcast_to(median_distance(distance, mask) + 1e-6, moment.shape)
    if config.scale_normalisation == "running":
        return _root_mean(*so_far)
    return _root_mean(moment, total) if config.scale_normalisation == "frame" else jnp.ones_like(moment)


def _root_mean(moment: Float[Array, "*frame"], total: Float[Array, "*frame"]) -> Float[Array, "*frame"]:
    return jnp.sqrt(moment / jnp.maximum(total, 1e-9) + 1e-12)


def column_vectors(
    position: Float[Array, "token 3"], columns: Float[Array, "token 14"], mode: Mode
) -> Float[Array, "token 3 vector"]:
    """Published lifting: the position and, with shape, the scaled principal axes s_k·R e_k.

    Depends on which of the 24 quaternions of an ellipsoid was stored.
    """
    if not uses_shape(mode):
        return position[..., None]
    axes = rotation_from_quaternion(columns[:, 3:7]) * columns[:, None, 7:10]
    return jnp.concatenate([position[..., None], axes], axis=-1)


def covariance_vectors(
    position: Float[Array, "token 3"], columns: Float[Array, "token 14"], mode: Mode
) -> Float[Array, "token 3 vector"]:
    """Sign- and order-free lifting: p, Σ̂p and Σ̂²p with Σ̂ = 3Σ/tr Σ.

    By Cayley-Hamilton every vector that is a function of Σ applied to p is a combination of these three; the size
    that the trace takes away is in `shape_invariants`.
    """
    if not uses_shape(mode):
        return position[..., None]
    # Division by the largest axis first keeps tr Σ away from the smallest floats.
    largest = jnp.maximum(jnp.abs(columns[:, 7:10]).max(axis=-1, keepdims=True), 1e-9)
    return covariance_products(position, covariance_from_axes(columns[:, 3:7], columns[:, 7:10] / largest))


def covariance_products(
    position: Float[Array, "token 3"], covariance: Float[Array, "token 3 3"]
) -> Float[Array, "token 3 vector"]:
    """p, Σ̂p and Σ̂²p with Σ̂ = 3Σ/tr Σ."""
    trace = jnp.maximum(jnp.trace(covariance, axis1=-2, axis2=-1), 1e-9)
    once = 3 * jnp.einsum("nij,nj->ni", covariance, position) / trace[:, None]
    twice = 3 * jnp.einsum("nij,nj->ni", covariance, once) / trace[:, None]
    return jnp.stack([position, once, twice], axis=-1)


def shape_invariants(scale: Float[Array, "token 3"]) -> Float[Array, "token 3"]:
    """Symmetric functions of the three scales (in radii): log size, log volume and anisotropy, each of order one.

    ½ log(tr Σ/3), ⅓ log √det Σ (both shifted by 4, a splat of 2 % of the radius) and tr Σ²/(tr Σ)² in [⅓, 1].
    """
    floored = jnp.abs(scale) + SMALLEST_RELATIVE_SCALE
    square = floored * floored
    trace = square.sum(axis=-1)
    size = 0.5 * jnp.log(trace / 3) + 4
    volume = jnp.log(floored).mean(axis=-1) + 4
    anisotropy = (square * square).sum(axis=-1) / (trace * trace)
    return jnp.stack([size, volume, anisotropy], axis=-1)


def merged_shape_invariants(covariance: Float[Array, "token 3 3"]) -> Float[Array, "token 3"]:
    """`shape_invariants` of covariances, without their eigenvalues: trace, determinant and square are symmetric too.

    The determinant is the product of the pivots of Cholesky's method, whose rounding is that of the entries.
    """
    trace = jnp.trace(covariance, axis1=-2, axis2=-1) + 3 * SMALLEST_RELATIVE_SCALE**2
    unit = 3 * covariance / trace[:, None, None] + SMALLEST_VARIANCE_SHARE * jnp.eye(3, dtype=covariance.dtype)[None]
    a, b, c = unit[:, 0, 0], unit[:, 0, 1], unit[:, 0, 2]
    second = unit[:, 1, 1] - b * b / a
    mixed = unit[:, 1, 2] - b * c / a
    third = unit[:, 2, 2] - c * c / a - mixed * mixed / second
    size = 0.5 * jnp.log(trace / 3) + 4
    # Pivots are at least the share that was added, but for rounding.
    pivots = jnp.maximum(jnp.stack([a, second, third]), 0.1 * SMALLEST_VARIANCE_SHARE)
    volume = size + jnp.log(pivots).sum(axis=0) / 6
    return jnp.stack([size, volume, jnp.sum(unit**2, axis=(1, 2)) / 9], axis=-1)


def published_invariants(columns: Float[Array, "token 14"], mode: Mode) -> Float[Array, "token invariant"]:
    """Opacity, then colour, as far as the mode reads them."""
    parts = [columns[:, 10:11]] * uses_opacity(mode) + [columns[:, 11:14]] * uses_colour(mode)
    return jnp.concatenate(parts, axis=-1) if parts else columns[:, :0]


class PublishedLifting(nnx.Module):
    """Centre on the token mean, mix the vectors into channels, append each invariant as a slot of every channel."""

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        vectors = 4 if uses_shape(config.mode) else 1
        self.linear = VNLinear(
            vectors, config.channels, key=key, init=weight_init(config), bias_epsilon=bias_epsilon(config)
        )
        self.mode: Mode = config.mode

    def __call__(
        self, columns: Float[Array, "token 14"], mask: Bool[Array, "token"]
    ) -> Float[Array, "token slot channel"]:
        """Lift one normalised frame; padded tokens are shifted too and must be masked downstream."""
        position = columns[:, :3] - masked_mean(columns[:, :3], mask)[None]
        x = self.linear(column_vectors(position, columns, self.mode))
        invariants = published_invariants(columns, self.mode)[..., None]
        return jnp.concatenate([x, jnp.broadcast_to(invariants, (*invariants.shape[:2], x.shape[-1]))], axis=1)


class ExactLifting(nnx.Module):
    """Vectors mixed into channels; all invariants and the constant 1 mixed into `scalar_slots` slots of each channel.

    The constant keeps a token's norm away from zero, where rounding would be blown up. A learned map instead of one
    slot per invariant makes a token 4 slots wide instead of 7, and the encoder that much cheaper.
    """

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        vector_key, scalar_key = jax.random.split(key)
        self.covariance = config.lifting == "covariance"
        self.mode: Mode = config.mode
        self.slots = config.scalar_slots
        shape = uses_shape(config.mode)
        vectors = 1 if not shape else 3 if self.covariance else 4
        invariants = 1 + uses_opacity(self.mode) + 3 * uses_colour(self.mode) + 3 * (shape and self.covariance)
        invariants += config.merged_tokens > 0
        self.linear = VNLinear(vectors, config.channels, key=vector_key)
        self.scalars = nnx.Param(draw_weight((self.slots * config.channels, invariants), "fan_in", key=scalar_key))

    def __call__(
        self, columns: Float[Array, "token 14"], mask: Bool[Array, "token"]
    ) -> Float[Array, "token slot channel"]:
        """Lift one frame that `normalise_clip` has centred and scaled."""
        vectors = (covariance_vectors if self.covariance else column_vectors)(columns[:, :3], columns, self.mode)
        invariants = [published_invariants(columns, self.mode)]
        if self.covariance and uses_shape(self.mode):
            invariants.append(shape_invariants(columns[:, 7:10]))
        return self._mix(vectors, invariants, mask)

    def merged(self, gaussians: MergedGaussians) -> Float[Array, "token slot channel"]:
        """Lift one frame's merged Gaussians; their mass, in shares of the mean one, is one more invariant of theirs."""
        vectors, mask = gaussians.mean[..., None], gaussians.mask
        invariants = [gaussians.opacity[:, None]] * uses_opacity(self.mode) + [gaussians.colour] * uses_colour(
            self.mode
        )
        if uses_shape(self.mode):
            vectors = covariance_products(gaussians.mean, gaussians.covariance)
            invariants.append(merged_shape_invariants(gaussians.covariance))
        mass = gaussians.share * mask.sum().astype(gaussians.share.dtype)
        invariants.append(jnp.log(jnp.maximum(mass, SMALLEST_MASS))[:, None])
        return self._mix(vectors, invariants, mask)

    def _mix(self, vectors: Array, invariants: list[Array], mask: Array) -> Float[Array, "token slot channel"]:
        scalars = jnp.concatenate([jnp.ones_like(vectors[:, :1, 0]), *invariants], axis=-1) @ self.scalars[...].T
        scalars = scalars.reshape(vectors.shape[0], self.slots, -1)
        return jnp.where(mask[:, None, None], jnp.concatenate([self.linear(vectors), scalars], axis=1), 0.0)
