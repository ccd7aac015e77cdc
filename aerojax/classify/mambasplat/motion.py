"""How a clip's object is shaped, moves and changes over time, as numbers that no rotation of the whole clip changes.

Each frame is read after a bounded state of the frames before it, so a stream gives what a clip does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from aerojax.core.arrays import pairwise_sum
from aerojax.core.types import pytree_dataclass

if TYPE_CHECKING:
    from aerojax.classify.mambasplat.config import MambaSplatConfig

MOTION_FEATURES = 6
SHAPE_FEATURES = 12
FLIGHT_FEATURES = 5
WINDOW = 16
"""Frames of the spectrum: wing beats of 1/16 of the frame rate up to half of it."""
SPECTRUM_FEATURES = SHAPE_FEATURES * (WINDOW // 2 + 1)
_REST = 1e-2
"""Speeds far below this share of the object's radius a frame have no direction worth a number: their cosines fade."""
_QUANTILES = (0.1, 0.5, 0.9, 1.0)
_SMOOTHING = 0.3
"""Weight of the newest velocity in the smoothed one: a memory of about three frames."""
_SPECTRUM_GAIN = 5.0
"""Shapes change by about a fifth of the radius."""


@pytree_dataclass
class MotionState:
    """What is remembered of the frames that had tokens.

    count: of those frames.
    centre: of the last one, metres: the rounded one, and how far from that the centre lies. Two parts keep the digits
        of steps that are small beside the distance from the origin.
    velocity, smooth: into it and smoothed, radii a frame.
    moment: its second moments, radii squared. window: shape invariants of the last frames, the newest last.
    """

    count: Float[Array, ""]
    centre: Float[Array, "2 3"]
    velocity: Float[Array, "3"]
    smooth: Float[Array, "3"]
    moment: Float[Array, "3 3"]
    window: Float[Array, "window shape"]


def motion_state(kind: jnp.dtype) -> MotionState:
    """The state before the first frame."""
    zero = jnp.zeros(3, kind)
    return MotionState(
        zero[0], jnp.zeros((2, 3), kind), zero, zero, jnp.zeros((3, 3), kind), jnp.zeros((WINDOW, SHAPE_FEATURES), kind)
    )


def feature_count(config: MambaSplatConfig) -> int:
    """How many numbers a frame has by the switches of the configuration."""
    count = MOTION_FEATURES * config.motion_features + SHAPE_FEATURES * config.shape_features
    return count + FLIGHT_FEATURES * config.flight_features + SPECTRUM_FEATURES * config.spectrum_features


def features_after(
    state: MotionState,
    position: Float[Array, "time token 3"],
    weights: Float[Array, "time token"],
    centre: Float[Array, "time 2 3"],
    radius: Float[Array, "time"],
    config: MambaSplatConfig,
) -> tuple[Float[Array, "time feature"], MotionState]:
    """Each frame's numbers and the state behind the last; frames without tokens give 0 and are as if not recorded.

    Args:
        state: of the frames before.
        position: Gaussians about their frame's centre, in units of its radius.
        weights: of tokens, 0 for those that do not count.
        centre: weighted mean of each frame, metres, in two parts as in the state.
        radius: that of each frame's normalisation, metres.
        config: which groups of numbers are wanted.
    """

    def read(state: MotionState, frame: tuple[Array, Array, Array, Array]) -> tuple[MotionState, Array]:
        seen = frame[1].sum() > 0
        features, following = _read(state, *frame, config)
        following = jax.tree.map(lambda new, old: jnp.where(seen, new, old), following, state)
        return following, jnp.where(seen, features, 0.0)

    state, features = jax.lax.scan(read, state, (position, weights, centre, radius))
    return features, state


def _read(
    state: MotionState, position: Array, weights: Array, centre: Array, radius: Array, config: MambaSplatConfig
) -> tuple[Float[Array, "feature"], MotionState]:
    share = weights / jnp.maximum(weights.sum(), 1e-9)
    moment = pairwise_sum(share[:, None, None] * position[:, :, None] * position[:, None])
    velocity = jnp.where(state.count > 0, (centre - state.centre).sum(axis=0) / radius, 0.0)
    smooth = jnp.where(state.count > 1, state.smooth + _SMOOTHING * (velocity - state.smooth), velocity)
    window, parts = state.window, []
    if config.shape_features or config.spectrum_features:
        shape = shape_features(position, weights > 0, share, moment)
        window = jnp.concatenate([window[1:], shape[None]])
        parts += [shape] * config.shape_features
    following = MotionState(state.count + 1, centre, velocity, smooth, moment, window)
    if config.motion_features:
        parts.append(jnp.where(state.count > 0, motion_features(state, following), 0.0))
    if config.flight_features:
        parts.append(jnp.where(state.count > 0, flight_features(state, following), 0.0))
    if config.spectrum_features:
        parts.append(spectrum_features(window, following.count))
    return jnp.concatenate(parts), following


def motion_features(before: MotionState, now: MotionState) -> Float[Array, "6"]:
    """Speed, turn and change of shape since the frame before.

    With velocity v (radii a frame) and second moments S of the frame's tokens (radii squared): log(1 + |v|); cosine of
    the turn; vᵀSv/|v|², how far the body reaches along its flight; overlap tr(SS')/(|S||S'|) with the frame before;
    |SS' - S'S|/(|S||S'|), how far it has turned; log of the ratio of sizes. All are invariant when the clip is turned
    or moved as a whole, and not when each frame is turned by itself.
    """
    speed, last = _length(now.velocity), _length(before.velocity)
    turn = now.velocity @ before.velocity / (speed * last + _REST**2)
    norms = _length(now.moment) * _length(before.moment) + 1e-9
    product = now.moment @ before.moment
    overlap, turned = jnp.trace(product) / norms, _length(product - product.T) / norms
    growth = jnp.log(jnp.trace(now.moment) + 1e-6) - jnp.log(jnp.trace(before.moment) + 1e-6)
    return jnp.stack([jnp.log1p(speed), turn, _along(now.velocity, now.moment), overlap, turned, growth])


def shape_features(
    position: Float[Array, "token 3"],
    mask: Bool[Array, "token"],
    share: Float[Array, "token"],
    moment: Float[Array, "3 3"],
) -> Float[Array, "12"]:
    """Invariants of one frame's cloud, lengths in radii.

    Standard deviations along the principal axes, the last of which is the thickness; the ratios of the smaller ones to
    the largest; distances from the centre below which 10, 50, 90 and 100 % of the tokens lie; |E[|x|²x]| and |E[xxx]|,
    which vanish for bodies that are their own point reflection; E[|x|⁴]/(2 E[|x|²]²).
    """
    axes = jnp.sqrt(principal_variances(position, share, moment) + 1e-6)
    square = jnp.sum(position**2, axis=-1)
    ordered = jnp.sort(jnp.where(mask, jnp.sqrt(square + 1e-12), jnp.inf))
    last = jnp.maximum(mask.sum() - 1, 0).astype(position.dtype)
    rank = jnp.array(_QUANTILES, position.dtype) * last
    lower = jnp.floor(rank).astype(int)
    upper = jnp.minimum(lower + 1, last.astype(int))
    low, high = (jnp.where(jnp.isfinite(ordered[i]), ordered[i], 0.0) for i in (lower, upper))
    quantiles = low + (rank - lower.astype(rank.dtype)) * (high - low)
    weighted = share[:, None] * position
    third = _length(pairwise_sum(jnp.einsum("ni,nj,nk->nijk", weighted, position, position)))
    skewness = _length(pairwise_sum(square[:, None] * weighted))
    peak = pairwise_sum(share * square**2) / (2 * pairwise_sum(share * square) ** 2 + 1e-6)
    return jnp.concatenate([axes, axes[1:] / axes[0], quantiles, jnp.stack([skewness, third, peak])])


def principal_variances(
    position: Float[Array, "token 3"], share: Float[Array, "token"], moment: Float[Array, "3 3"]
) -> Float[Array, "3"]:
    """Variances along the principal axes, the largest first.

    Solvers round each eigenvalue by 1e-7 of the largest, which is much of a thin body's thickness. Here only the axes
    are theirs; the variance along an axis is a sum of squares, to which an error of the axis is of second order
    (Rayleigh's quotient, Golub & Van Loan 2013, §8.2). So the axes are constants to a gradient, too.
    """
    axes = jax.lax.stop_gradient(jnp.linalg.eigh(moment)[1][:, ::-1])
    along = position @ axes
    return pairwise_sum(share[:, None] * along * along) / jnp.sum(axes * axes, axis=0)


def flight_features(before: MotionState, now: MotionState) -> Float[Array, "5"]:
    """Of the smoothed velocity w, radii a frame: log(1 + |w|), cosine of its turn, its change in shares of its length,
    how far the body reaches along it, and how much faster than w the object moves now.
    """
    speed, last = _length(now.smooth), _length(before.smooth)
    turn = now.smooth @ before.smooth / (speed * last + _REST**2)
    bend = jnp.where(before.count > 1, jnp.log1p(_length(now.smooth - before.smooth) / (speed + _REST)), 0.0)
    gain = jnp.log1p(_length(now.velocity)) - jnp.log1p(speed)
    return jnp.stack([jnp.log1p(speed), turn, bend, jnp.sqrt(_along(now.smooth, now.moment) + 1e-12), gain])


def spectrum_features(window: Float[Array, "window shape"], count: Float[Array, ""]) -> Float[Array, "feature"]:
    """How the shape invariants swing over the window: amplitudes at 1..8 periods a window, then standard deviations.

    Frames before the first one count as the mean.
    """
    frames = jnp.minimum(count, WINDOW)
    real = (jnp.arange(WINDOW, dtype=window.dtype) >= WINDOW - frames)[:, None]
    mean = jnp.sum(jnp.where(real, window, 0.0), axis=0, keepdims=True) / frames
    swing = jnp.where(real, window - mean, 0.0)
    angle = 2 * np.pi * np.outer(np.arange(1, WINDOW // 2 + 1), np.arange(WINDOW)) / WINDOW
    cosine, sine = (jnp.asarray(wave, window.dtype) @ swing for wave in (np.cos(angle), np.sin(angle)))
    # Half the frequency that is sampled has no sine: its amplitude is counted once.
    weight = jnp.asarray(np.where(np.arange(1, WINDOW // 2 + 1) < WINDOW // 2, 2.0, 1.0), window.dtype)
    amplitude = jnp.sqrt(cosine**2 + sine**2 + 1e-8) * weight[:, None] / frames
    deviation = jnp.sqrt(jnp.sum(swing**2, axis=0) / frames + 1e-8)
    return _SPECTRUM_GAIN * jnp.concatenate([amplitude.ravel(), deviation])


def _length(x: Float[Array, "*axis"]) -> Float[Array, ""]:
    return jnp.sqrt(jnp.sum(x**2) + 1e-12)


def _along(velocity: Float[Array, "3"], moment: Float[Array, "3 3"]) -> Float[Array, ""]:
    """Variance of the body along its flight; fades at rest."""
    return velocity @ moment @ velocity / (jnp.sum(velocity**2) + _REST**2)


def median_distance(distance: Float[Array, "time token"], mask: Bool[Array, "time token"]) -> Float[Array, ""]:
    """Median over all valid tokens, the lower one of an even number; 0 without any."""
    ordered = jnp.sort(jnp.where(mask, distance, jnp.inf).ravel())
    count = mask.sum()
    return jnp.where(count > 0, ordered[jnp.maximum(count - 1, 0) // 2], 0.0)
