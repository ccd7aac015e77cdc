"""Vector-neuron layers: linear maps, rectifiers and norms that commute with rotations.

A token is a matrix (slot, channel). Slots 0..2 are the coordinates of `channel` vectors, further slots hold invariants;
a rotation acts on the first three slots from the left, every layer here acts on channels from the right, so they
commute. The channel axis is last because that makes each linear map one matrix product over all tokens and slots.
(Deng et al. 2021, Vector Neurons; Assaad et al. 2022, VN-Transformer.)
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float, Key

from aerojax.classify.mambasplat.layers import over_last_axis

Init = Literal["fan_in", "unit"]


def draw_weight(shape: tuple[int, ...], init: Init, *, key: Key[Array, ""]) -> Float[Array, "..."]:
    """Normal weights (out, in): variance 1/in, or 1 as in the published code."""
    weight = jax.random.normal(key, shape)
    return weight / jnp.sqrt(float(shape[-1])) if init == "fan_in" else weight


@jax.custom_vjp
def mix_channels(
    x: Float[Array, "*batch inputs"], weight: Float[Array, "outputs inputs"]
) -> Float[Array, "*batch outputs"]:
    """x Wᵀ over the last axis, with a gradient that keeps the wider operand in memory order.

    A weight gradient contracts over all tokens, so one operand has to be transposed. Automatic differentiation
    transposes the cotangent, which is the wide one where channels are widened; here it is always the narrow one.
    """
    return x @ weight.T


def _mix_channels_forward(x: Array, weight: Array) -> tuple[Array, tuple[Array, Array]]:
    return x @ weight.T, (x, weight)


def _mix_channels_backward(saved: tuple[Array, Array], cotangent: Array) -> tuple[Array, Array]:
    x, weight = saved
    outputs, inputs = weight.shape
    rows, row_cotangents = x.reshape(-1, inputs), cotangent.reshape(-1, outputs)
    gradient = (rows.T @ row_cotangents).T if inputs < outputs else row_cotangents.T @ rows
    return cotangent @ weight, gradient


mix_channels.defvjp(_mix_channels_forward, _mix_channels_backward)


class VNLinear(nnx.Module):
    """y = W x over channels, optionally plus ε·b/‖b‖ in every slot (the published bias, which is not equivariant)."""

    def __init__(
        self, inputs: int, outputs: int, *, key: Key[Array, ""], init: Init = "fan_in", bias_epsilon: float = 0.0
    ):
        weight_key, bias_key = jax.random.split(key)
        self.weight = nnx.Param(draw_weight((outputs, inputs), init, key=weight_key))
        self.bias = nnx.Param(jax.random.normal(bias_key, (outputs,))) if bias_epsilon else None
        self.bias_epsilon = bias_epsilon

    def __call__(self, x: Float[Array, "*batch inputs"]) -> Float[Array, "*batch outputs"]:
        """Mix channels; the same for every slot."""
        y, offset = mix_channels(x, self.weight[...]), self.offset()
        return y if offset is None else y + over_last_axis(offset, y)

    def offset(self) -> Float[Array, "outputs"] | None:
        """What is added to every slot, ε·b/‖b‖; None without a bias."""
        if self.bias is None:
            return None
        bias = self.bias[...]
        return self.bias_epsilon * bias / jnp.maximum(jnp.linalg.norm(bias), 1e-12)


@partial(jax.custom_vjp, nondiff_argnums=(2,))
def clip_to_half_space(
    q: Float[Array, "*batch slot channel"], k: Float[Array, "*batch slot channel"], slope: float = 0.0
) -> Float[Array, "*batch slot channel"]:
    """The vector-neuron rectifier: where ⟨q, k⟩ < 0, remove (1-slope) of q's component along k.

    q - (1-slope)·min(⟨q,k⟩, 0)·k/‖k‖², for slope 0 the orthogonal projection on ⟨x,k⟩ ≥ 0; products run over slots.
    Unit k is k/max(‖k‖, 1e-6); written in squares there is no root whose gradient could be infinite. The hand-written
    gradient reads q and k once instead of storing every intermediate.
    """
    inner, square = _over_slots(q, k), _over_slots(k, k)
    return q - (1 - slope) * jnp.minimum(inner, 0.0) / jnp.maximum(square, SMALLEST_SQUARE) * k


SMALLEST_SQUARE = 1e-12


def _over_slots(a: Array, b: Array) -> Array:
    return jnp.einsum("...sc,...sc->...c", a, b)[..., None, :]


def _clip_forward(q: Array, k: Array, slope: float) -> tuple[Array, tuple[Array, Array]]:
    return clip_to_half_space(q, k, slope), (q, k)


def _clip_backward(slope: float, saved: tuple[Array, Array], g: Array) -> tuple[Array, Array]:
    q, k = saved
    inner, square = _over_slots(q, k), _over_slots(k, k)
    active = jnp.where(inner < 0, (1 - slope) / jnp.maximum(square, SMALLEST_SQUARE), 0.0)
    # y = q - a·⟨q,k⟩·k with a = (1-slope)/‖k‖² where active; below the smallest square a is constant.
    along = active * _over_slots(g, k)
    removed = active * inner
    shrink = jnp.where(square > SMALLEST_SQUARE, 2 * along * inner / jnp.maximum(square, SMALLEST_SQUARE), 0.0)
    return g - along * k, shrink * k - along * q - removed * g


clip_to_half_space.defvjp(_clip_forward, _clip_backward)


class VNRectifier(nnx.Module):
    """`clip_to_half_space` of a learned feature W x against a learned direction U x."""

    def __init__(self, inputs: int, outputs: int, *, key: Key[Array, ""], init: Init = "fan_in", slope: float = 0.0):
        feature_key, direction_key = jax.random.split(key)
        self.W = nnx.Param(draw_weight((outputs, inputs), init, key=feature_key))
        self.U = nnx.Param(draw_weight((outputs, inputs), init, key=direction_key))
        self.slope = slope

    def __call__(self, x: Float[Array, "*batch slot inputs"]) -> Float[Array, "*batch slot outputs"]:
        """Rectify."""
        return clip_to_half_space(mix_channels(x, self.W[...]), mix_channels(x, self.U[...]), self.slope)

    def behind(self, linear: VNLinear, x: Float[Array, "*batch slot narrow"]) -> Float[Array, "*batch slot outputs"]:
        """Rectify `linear(x)`. Two linear maps in a row are one, whose weights are their product: so no token is ever
        as wide as the map between them."""

        def map_of(weight: Array) -> Array:
            y, offset = mix_channels(x, weight @ linear.weight[...]), linear.offset()
            return y if offset is None else y + over_last_axis(weight @ offset, y)

        return clip_to_half_space(map_of(self.W[...]), map_of(self.U[...]), self.slope)


SMALLEST_LENGTH = 1e-6
SMALLEST_VARIANCE = 1e-5


@jax.custom_vjp
def normalise_lengths(
    x: Float[Array, "*batch slot channel"], gain: Float[Array, "channel"]
) -> Float[Array, "*batch slot channel"]:
    """x/max(‖x‖, 1e-6) · LayerNorm(‖x‖) over channels, ε 1e-5; zero vectors stay zero.

    The hand-written gradient is one sum over the slots of each channel, a layer norm's gradient on the lengths alone,
    and one product.
    """
    length, _, normalised = _lengths(x)
    return x * (normalised * over_last_axis(gain, x) / jnp.maximum(length, SMALLEST_LENGTH))


def _lengths(x: Array) -> tuple[Array, Array, Array]:
    """Lengths of a token's vectors, the inverse of their standard deviation, and the normalised lengths."""
    square = _over_slots(x, x)
    length = jnp.sqrt(square)
    centred = length - length.mean(axis=-1, keepdims=True)
    inverse = jax.lax.rsqrt(jnp.mean(centred * centred, axis=-1, keepdims=True) + SMALLEST_VARIANCE)
    return length, inverse, centred * inverse


def _lengths_forward(x: Array, gain: Array) -> tuple[Array, tuple[Array, Array]]:
    return normalise_lengths(x, gain), (x, gain)


def _lengths_backward(saved: tuple[Array, Array], g: Array) -> tuple[Array, Array]:
    x, gain = saved
    length, inverse, normalised = _lengths(x)
    bounded, wide = jnp.maximum(length, SMALLEST_LENGTH), over_last_axis(gain, x)
    # y = x·m/ℓ with m = gain·normalised: what reaches m of a channel, and from there its length.
    to_m = _over_slots(g, x) / bounded
    scaled = to_m * wide
    along = jnp.mean(scaled * normalised, axis=-1, keepdims=True)
    to_length = inverse * (scaled - scaled.mean(axis=-1, keepdims=True) - normalised * along)
    factor = normalised * wide / bounded
    to_length = to_length - jnp.where(length > SMALLEST_LENGTH, to_m * factor, 0.0)
    to_x = g * factor + x * jnp.where(length > 0, to_length / jnp.where(length > 0, length, 1.0), 0.0)
    channels = x.shape[-1]
    return to_x, jnp.einsum("nc,nc->c", to_m.reshape(-1, channels), normalised.reshape(-1, channels))


normalise_lengths.defvjp(_lengths_forward, _lengths_backward)


class VNLayerNorm(nnx.Module):
    """Published norm: each vector keeps its direction and gets the layer-normalised length of its channel.

    Jumps at the zero vector and can flip vectors, because a normalised length may be negative.
    """

    def __init__(self, channels: int):
        self.gain = nnx.Param(jnp.ones(channels))

    def __call__(self, x: Float[Array, "*batch slot channel"]) -> Float[Array, "*batch slot channel"]:
        """Normalise."""
        return normalise_lengths(x, self.gain[...])


SMALLEST_MEAN_SQUARE = 1e-6


@jax.custom_vjp
def divide_by_rms(
    x: Float[Array, "*batch slot channel"], gain: Float[Array, "channel"]
) -> Float[Array, "*batch slot channel"]:
    """x·gain/√(Σ_s,c x²/channels + 1e-6), one factor a token.

    The hand-written gradient is two sums over a token and one product, instead of a sum over the slots of each channel
    that the compiler does one token after another.
    """
    return x * (_inverse_rms(x) * over_last_axis(gain, x))


def _inverse_rms(x: Array) -> Array:
    return jax.lax.rsqrt(_over_token(x, x) / x.shape[-1] + SMALLEST_MEAN_SQUARE)


def _over_token(a: Array, b: Array) -> Array:
    flat = (*a.shape[:-2], -1)
    return jnp.sum(a.reshape(flat) * b.reshape(flat), axis=-1)[..., None, None]


def _divide_forward(x: Array, gain: Array) -> tuple[Array, tuple[Array, Array]]:
    return divide_by_rms(x, gain), (x, gain)


def _divide_backward(saved: tuple[Array, Array], g: Array) -> tuple[Array, Array]:
    x, gain = saved
    inverse, scaled = _inverse_rms(x), g * over_last_axis(gain, x)
    unit = x * inverse
    to_x = inverse * (scaled - unit * (_over_token(scaled, unit) / x.shape[-1]))
    return to_x, jnp.einsum("nc,nc->c", g.reshape(-1, g.shape[-1]), unit.reshape(-1, g.shape[-1]))


divide_by_rms.defvjp(_divide_forward, _divide_backward)


class VNRMSNorm(nnx.Module):
    """x·g/rms_c‖x_c‖: one positive factor a token, so directions stay and zero goes to zero continuously."""

    def __init__(self, channels: int):
        self.gain = nnx.Param(jnp.ones(channels))

    def __call__(self, x: Float[Array, "*batch slot channel"]) -> Float[Array, "*batch slot channel"]:
        """Normalise; ε 1e-6 under the root, so lengths far below 1e-3 shrink instead of being blown up."""
        return divide_by_rms(x, self.gain[...])
