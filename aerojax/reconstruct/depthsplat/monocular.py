"""The monocular branch: DINOv2's ViT-S/14 (Oquab et al. 2023) as Depth-Anything-V2 tuned it (Yang et al. 2024)."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float

from aerojax.reconstruct.depthsplat.config import PATCH, TAPS, DepthSplatSizes
from aerojax.reconstruct.depthsplat.draws import Draws
from aerojax.reconstruct.depthsplat.grids import resize_areas, resize_positions
from aerojax.reconstruct.depthsplat.layers import VISION_DEVIATION, Convolution, LayerNorm, Linear, gelu, over_last_axis

EPSILON = 1e-6
"""Added to variances in this branch."""
MLP_FACTOR = 4
SCALE_START = 1.0
"""What layer scales start with; DINOv2's training set them."""


class ViTBlock(nnx.Module):
    """x + γ₁·attention(norm x), then x + γ₂·MLP(norm x)."""

    def __init__(self, width: int, heads: int, *, draws: Draws):
        self.norm_attention = LayerNorm(width, epsilon=EPSILON)
        self.qkv = Linear(width, 3 * width, draws=draws, start="vision")
        self.out = Linear(width, width, draws=draws, start="vision")
        self.scale_attention = nnx.Param(SCALE_START * jnp.ones(width))
        self.norm_mlp = LayerNorm(width, epsilon=EPSILON)
        self.widen = Linear(width, MLP_FACTOR * width, draws=draws, start="vision")
        self.narrow = Linear(MLP_FACTOR * width, width, draws=draws, start="vision")
        self.scale_mlp = nnx.Param(SCALE_START * jnp.ones(width))
        self.heads = heads

    def __call__(self, x: Float[Array, "view token width"]) -> Float[Array, "view token width"]:
        """One block."""
        x = x + over_last_axis(self.scale_attention[...], x) * self._attend(self.norm_attention(x))
        hidden = gelu(self.widen(self.norm_mlp(x)))
        return x + over_last_axis(self.scale_mlp[...], x) * self.narrow(hidden)

    def _attend(self, x: Float[Array, "view token width"]) -> Float[Array, "view token width"]:
        view, token, width = x.shape
        split = self.qkv(x).reshape(view, token, 3, self.heads, width // self.heads)
        query, key, value = split[:, :, 0], split[:, :, 1], split[:, :, 2]
        return self.out(_patch_attention(query, key, value).reshape(view, token, width))


# A compiled part of its own, so that `cost` can tell it from the network's other products.
@jax.jit
def _patch_attention(
    query: Float[Array, "view token head channel"],
    key: Float[Array, "view token head channel"],
    value: Float[Array, "view token head channel"],
) -> Float[Array, "view token head channel"]:
    scores = jnp.einsum("vthc,vkhc->vhtk", query, key) / math.sqrt(query.shape[-1])
    return jnp.einsum("vhtk,vkhc->vthc", jax.nn.softmax(scores, axis=-1), value)


class MonocularBranch(nnx.Module):
    """Patches of 14×14 pixels, a class token, position embeddings, blocks; read after `TAPS` of them."""

    def __init__(self, config: DepthSplatSizes, *, draws: Draws):
        width, side = config.vit_width, config.vit_grid
        self.patch = Convolution(3, width, PATCH, draws=draws, stride=PATCH)
        self.token = nnx.Param(draws.normal((1, 1, width), 1e-6))
        self.positions = nnx.Param(draws.normal((1, side * side + 1, width), VISION_DEVIATION))
        self.blocks = draws.stacked(lambda part: ViTBlock(width, config.vit_heads, draws=part), config.vit_blocks)
        self.norm = LayerNorm(width, epsilon=EPSILON)
        self.side, self.every, self.compat = side, config.vit_blocks // TAPS, config.compat

    def __call__(
        self, images: Float[Array, "view height width 3"]
    ) -> tuple[Float[Array, "view patches patches channel"], ...]:
        """Normalised features of the patches after every quarter of the blocks, first to last."""
        tokens = self.tokens(images)

        def block(x: Array, layer: ViTBlock) -> tuple[Array, Array]:
            y = layer(x)
            return y, y

        outputs = jax.lax.scan(block, tokens, self.blocks)[1][self.every - 1 :: self.every]
        side = math.isqrt(tokens.shape[1] - 1)
        return tuple(self.norm(out[:, 1:]).reshape(len(images), side, side, -1) for out in outputs)

    def resized(self, images: Float[Array, "view height width 3"]) -> Float[Array, "view rows columns 3"]:
        """The images at the nearest smaller size of whole patches."""
        return resize_areas(images, images.shape[1] // PATCH * PATCH, compat=self.compat)

    def position_table(self, patches: int) -> Float[Array, "token width"]:
        """Embeddings of the class token and of `patches`² patches."""
        stored = self.positions[...][0]
        table = resize_positions(stored[1:].reshape(self.side, self.side, -1), patches)
        return jnp.concatenate([stored[:1], table.reshape(patches * patches, -1)])

    def tokens(self, images: Float[Array, "view height width 3"]) -> Float[Array, "view token channel"]:
        """What the first block reads."""
        x = self.resized(images)
        # Whole patches without a border: one product instead of a convolution that pads.
        patches = x.shape[1] // PATCH
        rows = x.reshape(len(x), patches, PATCH, patches, PATCH, 3).transpose(0, 1, 3, 5, 2, 4)
        weight = self.patch.weight[...]
        x = rows.reshape(len(x), patches * patches, -1) @ weight.reshape(weight.shape[0], -1).T
        assert self.patch.bias is not None
        x = x + over_last_axis(self.patch.bias[...], x)
        token = jnp.broadcast_to(self.token[...], (len(x), 1, x.shape[-1]))
        return jnp.concatenate([token, x], axis=1) + self.position_table(patches)[None]
