"""The network of one update: from what the views say of each Gaussian to its bounded change.

Every input is a length, an angle or a vector in the frame of a camera or of the Gaussian itself, and every change is
given in such a frame, so that turning the rig turns the answer. Views are pooled by weighted mean, maximum and
variance: neither their order nor their number is built in.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Key

from aerojax.core.types import View
from aerojax.geometry.rotations import rotation_from_quaternion
from aerojax.reconstruct.refine.feedback import Feedback
from aerojax.reconstruct.refine.neighbours import Neighbours
from aerojax.reconstruct.refine.parameters import Parameters, Update
from aerojax.reconstruct.refine.sampling import ERROR, Lengths, Pyramid, sample_width, sampled, seen_by

if TYPE_CHECKING:
    from aerojax.reconstruct.refine.config import RefineConfig

_OWN = 8
"""Numbers of a Gaussian itself."""
_RELATIVE = 8
"""Numbers of a neighbour."""
_OWN_CHANGES = 13
_VIEW_CHANGES = 5
_GAIN = 2.0
"""A splat shows the error of its colour weakened by its alpha; the colour head may take off twice what is seen."""


class Mlp(nnx.Module):
    """Two dense layers with a GELU between."""

    def __init__(self, inputs: int, hidden: int, outputs: int, *, rngs: nnx.Rngs):
        self.first = nnx.Linear(inputs, hidden, rngs=rngs)
        self.second = nnx.Linear(hidden, outputs, rngs=rngs)

    def __call__(self, x: Float[Array, "*batch inputs"]) -> Float[Array, "*batch outputs"]:
        """Apply to the last axis."""
        return self.second(nnx.gelu(self.first(x)))


class RefineNetwork(nnx.Module):
    """One update's network; its last layers begin at zero, so that it begins by changing nothing."""

    def __init__(self, config: RefineConfig, *, key: Key[Array, ""]):
        rngs, width = nnx.Rngs(params=key), config.width
        self.width = width
        self.pyramid = Pyramid(config.channels, rngs=rngs)
        self.view_sample = nnx.Linear(sample_width(config.channels), width, rngs=rngs)
        self.view_state = nnx.Linear(width + _OWN, width, rngs=rngs)
        self.view = nnx.Linear(width, width, rngs=rngs)
        self.score = nnx.Linear(width, 1, use_bias=False, rngs=rngs)
        self.pool = Mlp(4 * width + _OWN, 2 * width, width, rngs=rngs)
        self.pool_norm = nnx.LayerNorm(width, rngs=rngs)
        self.message = nnx.Linear(width, width, rngs=rngs)
        self.relative = nnx.Linear(_RELATIVE, width, rngs=rngs)
        self.exchange = Mlp(3 * width, 2 * width, width, rngs=rngs)
        self.exchange_norm = nnx.LayerNorm(width, rngs=rngs)
        zeros = nnx.initializers.zeros
        self.own_head = nnx.Linear(width, _OWN_CHANGES, kernel_init=zeros, rngs=rngs)
        self.view_head = nnx.Linear(width, _VIEW_CHANGES, kernel_init=zeros, rngs=rngs)
        self.state_head = nnx.Linear(width, _VIEW_CHANGES, kernel_init=zeros, use_bias=False, rngs=rngs)

    def initial(self, gaussians: int) -> Float[Array, "gaussian width"]:
        """What is remembered before the first update."""
        return jnp.zeros((gaussians, self.width))

    def __call__(
        self,
        now: Parameters,
        memory: Float[Array, "gaussian width"],
        seen: Feedback,
        views: View,
        valid: Bool[Array, "view"],
        near: Neighbours,
        lengths: Lengths,
    ) -> tuple[Update, Float[Array, "gaussian width"]]:
        """The change and what is remembered.

        Args:
            now: Gaussians in the cameras' frame; as inputs they are not differentiated.
            memory: from `initial` or the last update.
            seen: what is wrong with them.
            views: their cameras are used, and which pixels are known: a view says nothing of Gaussians in others.
            valid: views that count.
            near: neighbours.
            lengths: units of length at each Gaussian.
        """
        now = jax.lax.stop_gradient(now)
        use = seen_by(now.mean, views, valid)[..., None]
        samples = sampled(now, lengths, seen, self.pyramid(seen.images), views)
        state = jnp.concatenate([memory, _own_numbers(now, lengths)], axis=-1)
        said = nnx.gelu(self.view(nnx.gelu(self.view_sample(samples) + self.view_state(state)[None])))
        memory = self.pool_norm(memory + self.pool(jnp.concatenate([*self._pooled(said, use), state], axis=-1)))
        memory = self.exchange_norm(memory + self._exchanged(memory, now, near, lengths))
        return self._change(memory, said, samples[..., ERROR], views, use), memory

    def _pooled(
        self, said: Float[Array, "view gaussian width"], use: Bool[Array, "view #gaussian 1"]
    ) -> tuple[Array, ...]:
        weight = _over_views(self.score(said), use)
        mean = jnp.sum(weight * said, axis=0)
        peak = jnp.where(jnp.any(use, axis=0), jnp.max(jnp.where(use, said, -jnp.inf), axis=0), 0.0)
        return mean, peak, jnp.sum(weight * (said - mean[None]) ** 2, axis=0)

    def _exchanged(
        self, memory: Float[Array, "gaussian width"], now: Parameters, near: Neighbours, lengths: Lengths
    ) -> Float[Array, "gaussian width"]:
        """What the neighbours say: mean and maximum of messages that know where they lie in the Gaussian's frame."""
        message = nnx.gelu(self.message(memory)[near.index] + self.relative(_relative(now, near, lengths)))
        message = jnp.where(near.real[..., None], message, 0.0)
        number = jnp.maximum(jnp.sum(near.real, axis=1, keepdims=True), 1).astype(message.dtype)
        pooled = (jnp.sum(message, axis=1) / number, jnp.max(message, axis=1))
        return self.exchange(jnp.concatenate([memory, *pooled], axis=-1))

    def _change(
        self,
        memory: Float[Array, "gaussian width"],
        said: Float[Array, "view gaussian width"],
        error: Float[Array, "view gaussian 3"],
        views: View,
        use: Bool[Array, "view #gaussian 1"],
    ) -> Update:
        own = jnp.tanh(self.own_head(memory))
        each = self.view_head(said) + self.state_head(memory)[None]
        weight = _over_views(each[..., 3:4], use)
        axes = views.camera.world_from_cam[:, :3, :3]
        return Update(
            shift=own[:, 0:3],
            turn=own[:, 3:6],
            log_scale=own[:, 6:9],
            logit=own[:, 9],
            colour=own[:, 10:13],
            along_cameras=jnp.einsum("vij,vgj->gi", axes, weight * jnp.tanh(each[..., 0:3])),
            error=_GAIN * jnp.sum(weight * jnp.tanh(each[..., 4:5]) * error, axis=0),
        )


def _own_numbers(now: Parameters, lengths: Lengths) -> Float[Array, "gaussian 8"]:
    scale = now.log_scale - jnp.log(lengths.pixel)[:, None]
    density = jnp.log(jnp.maximum(lengths.spacing / lengths.pixel, 0.1))
    return jnp.concatenate([now.logit[:, None] / 4.0, scale, now.colour - 0.5, density[:, None]], axis=-1)


def _relative(now: Parameters, near: Neighbours, lengths: Lengths) -> Float[Array, "gaussian neighbour 8"]:
    """Place in the Gaussian's frame over the spacing, distance, difference of colour, cosine of the normals."""
    axes = rotation_from_quaternion(now.quaternion)
    unit = jnp.maximum(lengths.spacing, lengths.pixel)[:, None, None]
    place = jnp.einsum("gji,gkj->gki", axes, now.mean[near.index] - now.mean[:, None]) / unit
    distance = jnp.sqrt(jnp.sum(place * place, axis=-1, keepdims=True))
    colour = now.colour[near.index] - now.colour[:, None]
    facing = jnp.einsum("gi,gki->gk", axes[:, :, 2], axes[near.index][..., 2])
    return jnp.concatenate([place, distance, colour, facing[..., None]], axis=-1)


def _over_views(
    score: Float[Array, "view gaussian 1"], use: Bool[Array, "view #gaussian 1"]
) -> Float[Array, "view gaussian 1"]:
    """Shares of the views that count, 0 for the others; all 0 where none counts."""
    share = jax.nn.softmax(jnp.where(use, score, -1e9), axis=0)
    return jnp.where(use, share, 0.0)
