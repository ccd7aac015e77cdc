"""The joint head of the two paths.

logits = logits of the Gaussian path + logits of the views path + a joint head's of both readouts; a path that has seen
nothing adds nothing, to the joint head neither. So what the answer owes to the Gaussians alone is exactly invariant to
rotations of the Gaussians, and what it owes to the views does not change when world and cameras turn together.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.fused.config import FusedConfig
from aerojax.classify.mambasplat.layers import LayerNorm, Linear, drop
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.views.model import ViewsNetwork
from aerojax.core.types import pytree_dataclass


@pytree_dataclass
class Reading:
    """What one path has read of a clip: what its head reads, and whether there was anything."""

    readout: Float[Array, "*time width"]
    seen: Bool[Array, "*time"]


class JointHead(nnx.Module):
    """LayerNorm of each readout, side by side with which of them there are → linear → ReLU → dropout → linear."""

    def __init__(self, config: FusedConfig, *, key: Key[Array, ""]):
        hidden, out = jax.random.split(key)
        widths = config.gaussians.d_model, 2 * config.views.d_model
        self.norm_gaussians, self.norm_views = LayerNorm(widths[0]), LayerNorm(widths[1])
        self.hidden = Linear(sum(widths) + 2, config.hidden, key=hidden)
        self.out = Linear(config.hidden, config.views.classes, key=out)
        self.rate = config.head_dropout

    def __call__(
        self, gaussians: Reading, views: Reading, *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "label"]:
        """Logits of one pair of readings."""
        parts = [
            jnp.where(gaussians.seen, self.norm_gaussians(gaussians.readout), 0.0),
            jnp.where(views.seen, self.norm_views(views.readout), 0.0),
            jnp.stack([gaussians.seen, views.seen]).astype(views.readout.dtype),
        ]
        return self.out(drop(jax.nn.relu(self.hidden(jnp.concatenate(parts))), self.rate, key=key))


class FusedNetwork(nnx.Module):
    """Both paths, whole and with heads of their own, and the joint head."""

    def __init__(self, config: FusedConfig, *, key: Key[Array, ""]):
        gaussians, views, joint = jax.random.split(key, 3)
        self.config = config
        self.gaussians = MambaSplat(config.gaussians, key=gaussians)
        self.views = ViewsNetwork(config.views, key=views)
        self.joint = JointHead(config, key=joint)

    def read_gaussians(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        *,
        key: Key[Array, ""] | None = None,
    ) -> Reading:
        """The Gaussian path after each frame; nothing where there are no tokens."""
        if columns.shape[-2] == 0:
            return self._nothing((columns.shape[0], self.config.gaussians.d_model))
        return Reading(*self.gaussians.readouts(columns, mask, key=key))

    def read_views(
        self,
        rgba: Float[Array, "time view size size 4"] | None,
        valid: Bool[Array, "time view"],
        *,
        key: Key[Array, ""] | None = None,
    ) -> Reading:
        """The views path after each frame; nothing without images."""
        if rgba is None:
            return self._nothing((valid.shape[0], 2 * self.config.views.d_model))
        return Reading(*self.views.readouts(rgba, valid, key=key))

    def answer(self, gaussians: Reading, views: Reading) -> Float[Array, "label"]:
        """Logits of one pair of readings."""
        return self.heads(gaussians, views)[0]

    def heads(
        self, gaussians: Reading, views: Reading, *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "head label"]:
        """Logits of the answer, of the Gaussian path alone and of the views path alone; `key` turns on dropout.

        With dropout the answer may miss a path, if the other has seen something; the heads of the paths never do.
        """
        first, second, third, path = (None,) * 4 if key is None else jax.random.split(key, 4)
        left = self.gaussians.head(gaussians.readout, key=first)
        right = self.views.head(views.readout, key=second)
        if path is not None:
            gaussians, views = self._drop_path(gaussians, views, key=path)
        joint = self.joint(gaussians, views, key=third)
        joint = joint + jnp.where(gaussians.seen, left, 0.0) + jnp.where(views.seen, right, 0.0)
        return jnp.stack([joint, left, right])

    def _drop_path(self, gaussians: Reading, views: Reading, *, key: Key[Array, ""]) -> tuple[Reading, Reading]:
        drawn, half = jax.random.uniform(key), self.config.path_dropout / 2
        without_gaussians = (drawn < half) & views.seen
        without_views = (drawn >= half) & (drawn < 2 * half) & gaussians.seen
        return (
            Reading(gaussians.readout, gaussians.seen & ~without_gaussians),
            Reading(views.readout, views.seen & ~without_views),
        )

    def _nothing(self, shape: tuple[int, int]) -> Reading:
        kind = jax.tree.leaves(self)[0].dtype
        return Reading(jnp.zeros(shape, kind), jnp.zeros(shape[0], bool))
