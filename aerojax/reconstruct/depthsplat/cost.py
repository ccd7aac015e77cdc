"""Parameters of the parts, and operations of one forward pass counted as the thesis counts them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.core.tensors import parameter_count
from aerojax.core.types import Camera, View
from aerojax.reconstruct.depthsplat.config import CELL, DepthSplatSizes
from aerojax.reconstruct.depthsplat.reconstructor import DepthSplat, untrained_depthsplat

UNSEEN = ("_resample_by", "_match", "_patch_attention")
"""Compiled parts in which PyTorch's counter sees no products: resampling, the comparison of features, which multiplies
and sums elementwise, and the attention of the monocular branch, which is one fused operation there."""
COVARIANCE, RAYS, COLOUR = 270, 50, 204
"""Operations of one Gaussian in upstream's adapter: R S Sᵀ Rᵀ and its turn to the world are five products of 3×3
matrices (5·54); a pixel's ray is K⁻¹u and a homogeneous transform (18 + 32); the coefficients of degree 1 and 2 of
three colours are turned by 3×3 and 5×5 matrices (54 + 150)."""


def part_sizes(config: DepthSplatSizes) -> dict[str, int]:
    """Number of parameters of every part, in the order of the encoder."""
    network = _shapes(config).network
    parts: Mapping[str, Any] = {
        "backbone": network.backbone,
        "transformer": network.transformer,
        "monocular": network.monocular,
        "regressor": (network.regressor.first, network.regressor.norm, network.regressor.unet, network.regressor.last),
        "straight": network.regressor.straight,
        "depth_head": network.depth_head,
        "depth_upsampler": (network.depth_upsampler, network.depth_residual),
        "feature_upsampler": network.feature_upsampler,
        "gaussian_regressor": network.gaussian_head.regress,
        "gaussian_head": (network.gaussian_head.first, network.gaussian_head.last),
    }
    return {name: parameter_count(part) for name, part in parts.items()}


def published_operations(config: DepthSplatSizes, views: int) -> int:
    """Floating-point operations of one frame: two for each multiply-add of a convolution or matrix product.

    This is what PyTorch's counter sees of the published encoder and its Gaussian adapter, by which the thesis states
    969.02 G for five views (Table 6.19): no norms, activations or softmax, nothing of `UNSEEN`, but the turns and
    projections of the plane sweep's points.

    Args:
        config: sizes; the adapter counts for colour coefficients up to degree 2, as the thesis has them.
        views: images of the frame.
    """
    size, cells = config.size, (config.size // CELL) ** 2
    pairs = views * min(views - 1, config.neighbours)
    geometry = 2 * 9 * pairs * cells * (config.candidates + 2)
    adapter = views * size * size * (COVARIANCE + RAYS + (COLOUR if config.sh_degree == 2 else 0))
    return _products(_encoding(config, views), UNSEEN) + geometry + adapter


def operations(config: DepthSplatSizes, views: int) -> int:
    """As `published_operations`, of what this encoder does: the monocular branch's attention counts, too."""
    hidden = tuple(name for name in UNSEEN if name != "_patch_attention")
    return _products(_encoding(config, views), hidden)


def _encoding(config: DepthSplatSizes, views: int) -> Any:
    """The encoder's program, of which nothing is run."""

    def zeros(*shape: int) -> jax.Array:
        return jnp.zeros((views, *shape))

    def encode(reconstructor: DepthSplat) -> Any:
        size = config.size
        camera = Camera(zeros(3, 3), zeros(4, 4), size, size)
        view = View(zeros(size, size, 3), zeros(size, size), camera)
        return reconstructor.network.encode(view, jnp.ones(views, bool)).raw

    return jax.make_jaxpr(encode)(_shapes(config)).jaxpr


def _shapes(config: DepthSplatSizes) -> DepthSplat:
    return jax.eval_shape(lambda key: untrained_depthsplat(config, key=key), jax.random.key(0))


def _products(program: Any, unseen: tuple[str, ...]) -> int:
    """Operations of the convolutions and matrix products of a program and of the programs within it."""
    total = 0
    for equation in program.eqns:
        if equation.primitive.name == "dot_general":
            (contracted, _), _ = equation.params["dimension_numbers"]
            left = equation.invars[0].aval.shape
            total += 2 * equation.outvars[0].aval.size * int(np.prod([left[axis] for axis in contracted]))
        elif equation.primitive.name == "conv_general_dilated":
            kernel, layout = equation.invars[1].aval, equation.params["dimension_numbers"]
            total += 2 * equation.outvars[0].aval.size * kernel.size // kernel.shape[layout.rhs_spec[0]]
        elif equation.params.get("name") not in unseen:
            times = equation.params["length"] if equation.primitive.name == "scan" else 1
            total += times * sum(_products(inner, unseen) for inner in _inner(equation.params))
    return total


def _inner(params: Mapping[str, Any]) -> Iterator[Any]:
    for value in params.values():
        for part in value if isinstance(value, tuple | list) else (value,):
            inner = getattr(part, "jaxpr", part)
            if hasattr(inner, "eqns"):
                yield inner
