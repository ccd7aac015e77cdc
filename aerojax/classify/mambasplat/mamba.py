"""The selective state-space model over time, as a parallel scan for clips and as a recurrence for streams.

(Gu & Dao 2023, Mamba; layer order of the residual stack as in the published code.)
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float, Key

from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.mambasplat.layers import LayerNorm, Linear, drop, over_last_axis
from aerojax.core.types import pytree_dataclass


@pytree_dataclass
class MambaState:
    """What one layer remembers between frames.

    convolution: the last d_conv-1 inputs of the causal convolution, oldest first.
    memory: the state-space state.
    """

    convolution: Float[Array, "*layer tap inner"]
    memory: Float[Array, "*layer inner state"]


class MambaMixer(nnx.Module):
    """One selective state-space layer: s_t = exp(Δ_t A) s_{t-1} + Δ_t B_t x_t, y_t = C_t s_t + D x_t, gated by z."""

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        width, inner, rank = config.d_model, config.expand * config.d_model, math.ceil(config.d_model / 16)
        in_key, conv_key, x_key, dt_key, bias_key, out_key = jax.random.split(key, 6)
        self.in_proj = Linear(width, 2 * inner, key=in_key, bias=False)
        bound = config.d_conv**-0.5
        self.conv_weight = nnx.Param(jax.random.uniform(conv_key, (inner, config.d_conv), minval=-bound, maxval=bound))
        self.conv_bias = nnx.Param(jnp.zeros(inner))
        self.x_proj = Linear(inner, rank + 2 * config.d_state, key=x_key, bias=False)
        self.dt_weight = nnx.Param(jax.random.uniform(dt_key, (inner, rank), minval=-(rank**-0.5), maxval=rank**-0.5))
        # Step sizes start log-uniform in [1e-3, 1e-1]; the bias is the inverse softplus of that.
        low, high = math.log(1e-3), math.log(1e-1)
        step = jnp.exp(jax.random.uniform(bias_key, (inner,), minval=low, maxval=high))
        self.dt_bias = nnx.Param(step + jnp.log(-jnp.expm1(-step)))
        self.A_log = nnx.Param(jnp.tile(jnp.log(jnp.arange(1.0, config.d_state + 1)), (inner, 1)))
        self.D = nnx.Param(jnp.ones(inner))
        self.out_proj = Linear(inner, width, key=out_key, bias=False)
        # Scaled by depth, because the residual stream sums the layers.
        self.out_proj.weight[...] = self.out_proj.weight[...] / math.sqrt(config.mamba_layers)

    def __call__(self, u: Float[Array, "time width"]) -> Float[Array, "time width"]:
        """Mix a clip along time, causally, from the zero state."""
        x, z = self._convolved(u)
        decay, drive, readout = self._select(x)

        def combine(a: tuple[Array, Array], b: tuple[Array, Array]) -> tuple[Array, Array]:
            return a[0] * b[0], b[0] * a[1] + b[1]

        states = jax.lax.associative_scan(combine, (decay, drive))[1]
        return self._emit(states, readout, x, z)

    def in_order(self, u: Float[Array, "time width"]) -> Float[Array, "time width"]:
        """The same, one time after the other, so that the states of all times never exist at once.

        The parallel scan passes over them again and again. For long sequences they are too many for a processor's
        caches.
        """
        x, z = self._convolved(u)
        dt, B, C = self._chosen(x)
        rate = -jnp.exp(self.A_log[...])

        def step(memory: Array, now: tuple[Array, ...]) -> tuple[Array, Array]:
            dt, driven, B, C = now
            memory = jnp.exp(dt[:, None] * rate) * memory + driven[:, None] * B[None]
            return memory, memory @ C

        read = jax.lax.scan(step, jnp.zeros(rate.shape, u.dtype), (dt, dt * x, B, C))[1]
        return self.out_proj((read + over_last_axis(self.D[...], x) * x) * jax.nn.silu(z))

    def _convolved(
        self, u: Float[Array, "time width"]
    ) -> tuple[Float[Array, "time inner"], Float[Array, "time inner"]]:
        """What the state is driven with, and the gate."""
        x, z = jnp.split(self.in_proj(u), 2, axis=-1)
        taps = self.conv_weight[...]
        padded = jnp.pad(x, ((taps.shape[1] - 1, 0), (0, 0)))
        x = sum(padded[j : j + x.shape[0]] * taps[None, :, j] for j in range(taps.shape[1]))
        return jax.nn.silu(x + self.conv_bias[...][None]), z

    def step(self, u: Float[Array, "width"], state: MambaState) -> tuple[Float[Array, "width"], MambaState]:
        """Mix one frame and return the next state; a clip step by step equals `__call__`."""
        x, z = jnp.split(self.in_proj(u), 2, axis=-1)
        window = jnp.concatenate([state.convolution, x[None]])
        x = jax.nn.silu(jnp.einsum("jc,cj->c", window, self.conv_weight[...]) + self.conv_bias[...])
        decay, drive, readout = self._select(x)
        memory = decay * state.memory + drive
        return self._emit(memory, readout, x, z), MambaState(window[1:], memory)

    def _select(self, x: Float[Array, "*time inner"]) -> tuple[Array, Array, Array]:
        """Decay exp(ΔA), drive ΔBx and readout C, all chosen by the input."""
        dt, B, C = self._chosen(x)
        decay = jnp.exp(jnp.einsum("...i,is->...is", dt, -jnp.exp(self.A_log[...])))
        return decay, jnp.einsum("...i,...s->...is", dt * x, B), C

    def _chosen(self, x: Float[Array, "*time inner"]) -> tuple[Array, Array, Array]:
        """Δ, B and C."""
        states, rank = self.A_log[...].shape[1], self.dt_weight[...].shape[1]
        low_rank, B, C = jnp.split(self.x_proj(x), [rank, rank + states], axis=-1)
        return jax.nn.softplus(low_rank @ self.dt_weight[...].T + over_last_axis(self.dt_bias[...], x)), B, C

    def _emit(self, states: Array, readout: Array, x: Array, z: Array) -> Array:
        y = jnp.einsum("...cs,...s->...c", states, readout) + over_last_axis(self.D[...], x) * x
        return self.out_proj(y * jax.nn.silu(z))


class MambaLayer(nnx.Module):
    """Norm and mixer of one layer."""

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        self.norm = LayerNorm(config.d_model)
        self.mixer = MambaMixer(config, key=key)


class MambaStack(nnx.Module):
    """Layers with a running residual r: r ← r + h, h ← mixer(LN(r)); the output is LN(r + h)."""

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        keys = jax.random.split(key, config.mamba_layers)
        self.layers = jax.vmap(lambda layer_key: MambaLayer(config, key=layer_key))(keys)
        self.norm = LayerNorm(config.d_model)
        self.count, self.dropout, self.drop_path = config.mamba_layers, config.dropout, config.drop_path
        self.state_shape = (config.d_conv - 1, config.expand * config.d_model, config.d_state)

    def __call__(
        self, hidden: Float[Array, "time width"], *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "time width"]:
        """Encode a clip; `key` turns on dropout and drop path (whose rate rises linearly over the layers)."""
        # Layer 0 has no branch in front of it, so its path is never dropped.
        rates = jnp.linspace(0.0, self.drop_path, self.count)
        keys = None if key is None else jax.random.split(key, (self.count, 2))

        def step(carry: tuple[Array, Array], inputs: tuple[MambaLayer, Array, Array | None]) -> tuple:
            (hidden, residual), (layer, rate, key) = carry, inputs
            path_key, element_key = (None, None) if key is None else key
            residual = residual + drop(hidden, rate, key=path_key, whole=True)
            return (drop(layer.mixer(layer.norm(residual)), self.dropout, key=element_key), residual), None

        carry = (hidden, jnp.zeros_like(hidden))
        (hidden, residual), _ = jax.lax.scan(step, carry, (self.layers, rates, keys), unroll=True)
        return self.norm(hidden + residual)

    def initial_state(self) -> MambaState:
        """The state before the first frame: zeros, one row a layer."""
        taps, inner, states = self.state_shape
        kind = self.norm.weight[...].dtype
        return MambaState(jnp.zeros((self.count, taps, inner), kind), jnp.zeros((self.count, inner, states), kind))

    def step(self, hidden: Float[Array, "width"], state: MambaState) -> tuple[Float[Array, "width"], MambaState]:
        """Encode one frame of a stream in constant time and memory."""

        def layer_step(carry: tuple[Array, Array], inputs: tuple[MambaLayer, MambaState]) -> tuple:
            (hidden, residual), (layer, state) = carry, inputs
            residual = residual + hidden
            hidden, state = layer.mixer.step(layer.norm(residual), state)
            return (hidden, residual), state

        carry = (hidden, jnp.zeros_like(hidden))
        (hidden, residual), state = jax.lax.scan(layer_step, carry, (self.layers, state))
        return self.norm(hidden + residual), state


def sinusoids(length: int, width: int) -> Float[Array, "time width"]:
    """Interleaved sine and cosine positions, base 10 000 (Vaswani et al. 2017, §3.5), computed in float32."""
    frequency = jnp.exp(jnp.arange(0, width, 2, dtype=jnp.float32) * (-math.log(10000.0) / width))
    angle = jnp.arange(length, dtype=jnp.float32)[:, None] * frequency[None]
    return jnp.stack([jnp.sin(angle), jnp.cos(angle)], axis=-1).reshape(length, width)
