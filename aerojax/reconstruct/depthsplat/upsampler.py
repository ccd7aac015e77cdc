"""Dense prediction: features of all resolutions, fused from coarse to fine (DPT, Ranftl et al. 2021)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float

from aerojax.core.types import pytree_dataclass
from aerojax.reconstruct.depthsplat.backbone import Pyramid
from aerojax.reconstruct.depthsplat.config import DepthSplatSizes
from aerojax.reconstruct.depthsplat.draws import Draws
from aerojax.reconstruct.depthsplat.grids import resize
from aerojax.reconstruct.depthsplat.layers import Convolution, Enlargement, gelu


@pytree_dataclass
class ViewFeatures:
    """What is known of every view before its depth is.

    convolved: by the backbone.
    matched: by the multi-view transformer, at 1/4 of the resolution.
    monocular: by the monocular branch, first blocks first, at 1/8.
    """

    convolved: Pyramid
    matched: Float[Array, "view quarter quarter channel"]
    monocular: tuple[Float[Array, "view eighth eighth width"], ...]


class ResidualUnit(nnx.Module):
    """ReLU-convolution twice, added to the input."""

    def __init__(self, width: int, *, draws: Draws):
        self.first = Convolution(width, width, draws=draws)
        self.second = Convolution(width, width, draws=draws)

    def __call__(self, x: Float[Array, "view height width channel"]) -> Float[Array, "view height width channel"]:
        """One unit."""
        return x + self.second(jax.nn.relu(self.first(jax.nn.relu(x))))


class Fusion(nnx.Module):
    """The finer map joins the coarser one, and both go to the next resolution."""

    def __init__(self, width: int, *, joins: bool, compat: bool, draws: Draws):
        self.finer = ResidualUnit(width, draws=draws) if joins else None
        self.both = ResidualUnit(width, draws=draws)
        self.out = Convolution(width, width, 1, draws=draws)
        self.compat = compat

    def __call__(
        self,
        x: Float[Array, "view height width channel"],
        finer: Float[Array, "view height width channel"] | None,
        cells: int,
    ) -> Float[Array, "view cells cells channel"]:
        """Fuse, and resample to `cells`² cells."""
        if self.finer is not None and finer is not None:
            x = x + self.finer(finer)
        return self.out(resize(self.both(x), cells, compat=self.compat))


class Upsampler(nnx.Module):
    """Features at full resolution from `ViewFeatures`, and from a coarse depth where one is given."""

    def __init__(self, config: DepthSplatSizes, width: int, *, depth: bool, draws: Draws):
        vit = config.vit_width
        widths = (vit // 8, vit // 4, vit // 2, vit)
        self.projections = nnx.List([Convolution(vit, w, 1, draws=draws) for w in widths])
        self.quadruple = Enlargement(widths[0], widths[0], 4, draws=draws)
        self.double = Enlargement(widths[1], widths[1], 2, draws=draws)
        self.halve = Convolution(widths[3], widths[3], draws=draws, stride=2)
        joined = (
            config.stem_width + config.half_width + widths[0],
            2 * config.width + widths[1] + depth,
            widths[2],
        )
        self.joins = nnx.List([Convolution(i, w, 1, draws=draws) for i, w in zip(joined, widths[:3], strict=True)])
        self.narrow = nnx.List([Convolution(w, width, draws=draws, bias=False) for w in widths])
        self.fusions = nnx.List(
            [Fusion(width, joins=level < 3, compat=config.compat, draws=draws) for level in range(4)]
        )

    def __call__(
        self, features: ViewFeatures, depth: Float[Array, "view quarter quarter"] | None = None
    ) -> Float[Array, "view size size width"]:
        """Fuse, coarsest first."""
        maps = [project(x) for project, x in zip(self.projections, features.monocular, strict=True)]
        convolved = features.convolved
        half = [convolved.half_first, convolved.half, self.quadruple(maps[0])]
        quarter = [convolved.quarter, self.double(maps[1]), features.matched]
        if depth is not None:
            quarter.append(depth[..., None])
        inputs = (jnp.concatenate(half, axis=-1), jnp.concatenate(quarter, axis=-1), maps[2])
        joined = [join(x) for join, x in zip(self.joins, inputs, strict=True)]
        levels = [narrow(x) for narrow, x in zip(self.narrow, [*joined, self.halve(maps[3])], strict=True)]
        x = self.fusions[3](levels[3], None, levels[2].shape[1])
        x = self.fusions[2](x, levels[2], levels[1].shape[1])
        x = self.fusions[1](x, levels[1], levels[0].shape[1])
        return self.fusions[0](x, levels[0], 2 * levels[0].shape[1])


class ResidualHead(nnx.Module):
    """Three convolutions to one number, which starts at zero."""

    def __init__(self, width: int, *, draws: Draws):
        half = width // 2
        self.first = Convolution(width, half, draws=draws, edge="nearest")
        self.second = Convolution(half, half, draws=draws, edge="nearest")
        self.last = Convolution(half, 1, 1, draws=draws, start="zero")

    def __call__(self, x: Float[Array, "view height width channel"]) -> Float[Array, "view height width"]:
        """What is added to the coarse depth."""
        return self.last(gelu(self.second(gelu(self.first(x)))))[..., 0]
