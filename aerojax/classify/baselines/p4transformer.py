"""P4Transformer: tubes of a clip become tokens of one transformer (Fan et al. 2021, CVPR; released `models/msr.py`).

Two things are as in the code and not as one would expect: a GELU stands behind the output map of attention, and none
behind the embedding of the tubes.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Int, Key

from aerojax.classify.baselines.config import TransformerSizes
from aerojax.classify.baselines.tubes import OFFSETS, Tubes, tubes, valid_anchor_frames, with_time
from aerojax.classify.mambasplat.layers import LayerNorm, Linear

_FAR = -1e9


class Attention(nnx.Module):
    """Softmax attention of many heads; linear map and GELU of their answers."""

    def __init__(self, sizes: TransformerSizes, *, key: Key[Array, ""]):
        inner, (read, out) = sizes.heads * sizes.head_width, jax.random.split(key)
        self.read = Linear(sizes.width, 3 * inner, key=read, bias=False)
        self.out = Linear(inner, sizes.width, key=out)
        self.heads = sizes.heads

    def __call__(self, x: Float[Array, "token width"], valid: Bool[Array, "token"]) -> Float[Array, "token width"]:
        """Every token reads all valid ones."""
        query, key, value = (
            jnp.moveaxis(part.reshape(x.shape[0], self.heads, -1), 1, 0) for part in jnp.split(self.read(x), 3, axis=-1)
        )
        scores = query @ jnp.swapaxes(key, 1, 2) * query.shape[-1] ** -0.5
        weights = jax.nn.softmax(jnp.where(valid[None, None], scores, _FAR), axis=-1)
        found = jnp.moveaxis(weights @ value, 0, 1).reshape(x.shape[0], -1)
        return jax.nn.gelu(self.out(found), approximate=False)


class Layer(nnx.Module):
    """x ← x + attention(LN(x)); x ← x + MLP(LN(x))."""

    def __init__(self, sizes: TransformerSizes, *, key: Key[Array, ""]):
        attention, hidden, out = jax.random.split(key, 3)
        self.attention_norm, self.attention = LayerNorm(sizes.width), Attention(sizes, key=attention)
        self.norm = LayerNorm(sizes.width)
        self.hidden = Linear(sizes.width, sizes.hidden, key=hidden)
        self.out = Linear(sizes.hidden, sizes.width, key=out)

    def __call__(self, x: Float[Array, "token width"], valid: Bool[Array, "token"]) -> Float[Array, "token width"]:
        """Apply to all tokens."""
        x = x + self.attention(self.attention_norm(x), valid)
        return x + self.out(jax.nn.gelu(self.hidden(self.norm(x)), approximate=False))


class ClipHead(nnx.Module):
    """LayerNorm → linear → GELU → linear."""

    def __init__(self, width: int, hidden: int, classes: int, *, key: Key[Array, ""]):
        first, second = jax.random.split(key)
        self.norm = LayerNorm(width)
        self.hidden = Linear(width, hidden, key=first)
        self.out = Linear(hidden, classes, key=second)

    def __call__(self, x: Float[Array, "width"]) -> Float[Array, "label"]:
        """Logits of one clip."""
        return self.out(jax.nn.gelu(self.hidden(self.norm(x)), approximate=False))


class P4Transformer(nnx.Module):
    """The network."""

    def __init__(self, sizes: TransformerSizes, classes: int, *, key: Key[Array, ""]):
        tube, position, layers, head = jax.random.split(key, 4)
        self.sizes = sizes
        self.tube = Linear(4, sizes.width, key=tube, bias=False)
        self.position = Linear(4, sizes.width, key=position)
        self.layers = jax.vmap(lambda each: Layer(sizes, key=each))(jax.random.split(layers, sizes.layers))
        self.head = ClipHead(sizes.width, sizes.hidden, classes, key=head)

    def __call__(
        self,
        points: Float[Array, "time token 3"],
        count: Int[Array, ""],
        *,
        key: Key[Array, ""] | None = None,
    ) -> Float[Array, "label"]:
        """Logits of one clip.

        Args:
            points: of `count` frames and then of any others.
            count: frames that are there, at least 1.
            key: nothing is dropped in training, as in the released recipe.
        """
        return self.answer(*self.embedded(points, count), valid_anchor_frames(count, points.shape[0]))

    def embedded(
        self, points: Float[Array, "time token 3"], count: Int[Array, ""], *, key: Key[Array, ""] | None = None
    ) -> tuple[Float[Array, "anchor_frame tube 3"], Float[Array, "anchor_frame tube width"]]:
        """Anchors, and what the tubes about them hold."""
        cut = tubes(points, count, self.sizes.tubes)
        return cut.anchors, self.tube_features(cut)

    def tube_features(self, cut: Tubes) -> Float[Array, "anchor_frame tube width"]:
        """Maxima of a linear map of the displacements (x, y, z, t) from the anchor."""
        displacement = cut.points - cut.anchors[:, None, :, None]
        step = jnp.asarray(OFFSETS, displacement.dtype).reshape(1, -1, 1, 1, 1)
        step = jnp.broadcast_to(step, (*displacement.shape[:-1], 1))
        return self.tube(jnp.concatenate([displacement, step], axis=-1)).max(axis=(1, 3))

    def answer(
        self,
        anchors: Float[Array, "anchor_frame tube 3"],
        features: Float[Array, "anchor_frame tube width"],
        valid: Bool[Array, "anchor_frame"],
        *,
        key: Key[Array, ""] | None = None,
    ) -> Float[Array, "label"]:
        """Logits from the tubes of the valid anchor frames."""
        tokens = (features + self.position(with_time(anchors))).reshape(-1, features.shape[-1])
        counted = jnp.repeat(valid, features.shape[1])

        def apply(x: Array, layer: Layer) -> tuple[Array, None]:
            return layer(x, counted), None

        tokens, _ = jax.lax.scan(apply, tokens, self.layers)
        return self.head(jnp.where(counted[:, None], tokens, _FAR).max(axis=0))
