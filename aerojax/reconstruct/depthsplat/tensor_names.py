"""The published encoder's tensor names beside ours, in both directions."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np

from aerojax.core.tensors import parameter_names
from aerojax.reconstruct.depthsplat.network import DepthSplatNetwork

MONOCULAR = "depth_predictor.pretrained."
"""Where the published encoder keeps the monocular branch; Depth-Anything-V2 keeps it at `pretrained.`."""

_UNET = r"depth_predictor.regressor.0.3"
_MODULES: tuple[tuple[str, str | Callable[[re.Match[str]], str]], ...] = (
    (r"^backbone\.stem", "depth_predictor.backbone.conv1"),
    (r"^backbone\.out", "depth_predictor.backbone.conv2"),
    (
        r"^backbone\.blocks\.(\d)",
        lambda m: f"depth_predictor.backbone.layer{int(m[1]) // 2 + 1}.{int(m[1]) % 2}",
    ),
    (r"^transformer\.blocks\.own", "depth_predictor.transformer.layers.*.self_attn"),
    (r"^transformer\.blocks\.(other|forward)", "depth_predictor.transformer.layers.*.cross_attn_ffn"),
    (r"^monocular\.patch", MONOCULAR + "patch_embed.proj"),
    (r"^monocular\.token", MONOCULAR + "cls_token"),
    (r"^monocular\.positions", MONOCULAR + "pos_embed"),
    (r"^monocular\.blocks", MONOCULAR + "blocks.*"),
    (r"^monocular\.norm", MONOCULAR + "norm"),
    (r"^regressor\.first", "depth_predictor.regressor.0.0"),
    (r"^regressor\.norm", "depth_predictor.regressor.0.1"),
    (r"^regressor\.last", "depth_predictor.regressor.0.4"),
    (r"^regressor\.straight", "depth_predictor.regressor_residual.0"),
    (r"^regressor\.unet\.stem", f"{_UNET}.input_blocks.0.0"),
    (r"^regressor\.unet\.down\.(\d)", lambda m: f"{_UNET}.input_blocks.{1 + 2 * int(m[1])}"),
    (r"^regressor\.unet\.halve\.(\d)", lambda m: f"{_UNET}.input_blocks.{2 + 2 * int(m[1])}.0.op"),
    (r"^regressor\.unet\.middle\.(\d)", lambda m: f"{_UNET}.middle_block.{2 * int(m[1])}"),
    (r"^regressor\.unet\.up", f"{_UNET}.output_blocks"),
    # Behind a block and, at the coarsest resolution, its attention.
    (r"^regressor\.unet\.double\.0", f"{_UNET}.output_blocks.1.2.conv"),
    (r"^regressor\.unet\.double\.1", f"{_UNET}.output_blocks.3.1.conv"),
    (r"^regressor\.unet\.norm", f"{_UNET}.out.0"),
    (r"^regressor\.unet\.out", f"{_UNET}.out.2"),
    (r"^depth_head\.first", "depth_predictor.depth_head.0.0"),
    (r"^depth_head\.last", "depth_predictor.depth_head.0.2"),
    (r"^depth_upsampler", "depth_predictor.upsampler"),
    (r"^depth_residual\.first", "depth_predictor.upsampler.scratch.output_conv.0"),
    (r"^depth_residual\.second", "depth_predictor.upsampler.scratch.output_conv.2"),
    (r"^depth_residual\.last", "depth_predictor.upsampler.scratch.output_conv.4"),
    (r"^gaussian_head\.regress\.(\d)", lambda m: f"gaussian_regressor.{2 * int(m[1])}"),
    (r"^gaussian_head\.first", "gaussian_head.0"),
    (r"^gaussian_head\.last", "gaussian_head.2"),
)
"""Patterns of our modules' names and what stands in their place; `*` is the number of a stacked block."""

_PARTS: tuple[tuple[str, Mapping[str, str]], ...] = (
    ("depth_predictor.backbone.layer", {"first": "conv1", "second": "conv2", "shortcut": "downsample.0"}),
    ("self_attn", {n: f"{n[0]}_proj" for n in ("query", "key", "value")} | {"norm": "norm1"}),
    (MONOCULAR + "blocks", {"norm_attention": "norm1", "qkv": "attn.qkv", "out": "attn.proj", "norm_mlp": "norm2"}),
    (MONOCULAR + "blocks", {"widen": "mlp.fc1", "narrow": "mlp.fc2"}),
    (MONOCULAR + "blocks", {"scale_attention": "ls1.gamma", "scale_mlp": "ls2.gamma"}),
    (_UNET, {"block": "0", "attention": "1"}),
    (_UNET, {"norm_first": "in_layers.0", "first": "in_layers.2", "shortcut": "skip_connection"}),
    (_UNET, {"norm_second": "out_layers.0", "second": "out_layers.3"}),
    ("upsampler.", {"projections": "projects", "joins": "concat_projects", "quadruple": "resize_layers.0"}),
    ("upsampler.", {"double": "resize_layers.1", "halve": "resize_layers.3"}),
    ("upsampler.", {"finer": "resConfUnit1", "both": "resConfUnit2", "out": "out_conv"}),
    ("upsampler.", {"first": "conv1", "second": "conv2"}),
)
"""Words of our names within modules whose published name holds the first text."""


def published_name(name: str) -> str:
    """The published name of one of our tensors, with `*` for the number of a stacked block."""
    found = name
    for pattern, replacement in _MODULES:
        found, count = re.subn(pattern + r"(?=\.|$)", replacement, name)
        if count:
            break
    if name.startswith("transformer.blocks.forward"):
        words = {"widen": "mlp.0", "narrow": "mlp.2", "norm": "norm2"}
    elif name.startswith("transformer.blocks.other"):
        words = dict(_PARTS[1][1])
    else:
        words = {ours: theirs for where, parts in _PARTS if where in found for ours, theirs in parts.items()}
    place, _, last = found.partition("upsampler.")
    found = f"{place}upsampler." + _numbered(last) if last else found
    found = ".".join(words.get(word, word) for word in found.split("."))
    # The projection of the U-Net's attention, not the convolution at its end.
    return re.sub(r"(blocks\.\d+\.1)\.out\b", r"\1.proj_out", found)


def _numbered(name: str) -> str:
    """Upstream counts resolutions from 1 and keeps their modules in one of its own."""
    name = re.sub(r"^narrow\.(\d)", lambda m: f"scratch.layer{int(m[1]) + 1}_rn", name)
    return re.sub(r"^fusions\.(\d)", lambda m: f"scratch.refinenet{int(m[1]) + 1}", name)


def published_tensors(network: Any) -> dict[str, Any]:
    """The network's parameters (or the gradient's, or their shapes) under the published names and shapes."""
    tensors: dict[str, Any] = {}
    for name, leaf in parameter_names(network):
        theirs = published_name(name)
        if "*" in theirs:
            tensors |= {theirs.replace("*", str(index)): part for index, part in enumerate(_layers(leaf))}
        else:
            tensors[theirs] = _line(leaf) if _is_line(theirs) else leaf
    return tensors


def network_from_published(tensors: Mapping[str, np.ndarray], shapes: DepthSplatNetwork) -> DepthSplatNetwork:
    """The network with published tensors in it.

    Args:
        tensors: exactly those of `published_tensors`, of their shapes.
        shapes: the network, or its shapes.
    """
    leaves = []
    for name, leaf in parameter_names(shapes):
        theirs = published_name(name)
        if "*" in theirs:
            value = np.stack([tensors[theirs.replace("*", str(index))] for index in range(leaf.shape[0])])
        else:
            value = tensors[theirs].reshape(leaf.shape)
        leaves.append(jax.numpy.asarray(value, leaf.dtype))
    return jax.tree.unflatten(jax.tree.structure(shapes), leaves)


def _is_line(theirs: str) -> bool:
    """Whether upstream writes a 1×1 convolution as one along a line: the attention of its U-Net."""
    return re.search(r"blocks\.\d+\.1\.(qkv|proj_out)\.weight$", theirs) is not None


def _line(leaf: Any) -> Any:
    shape = leaf.shape[:-1]
    return jax.ShapeDtypeStruct(shape, leaf.dtype) if isinstance(leaf, jax.ShapeDtypeStruct) else leaf.reshape(shape)


def _layers(leaf: Any) -> list[Any]:
    if isinstance(leaf, jax.ShapeDtypeStruct):
        return [jax.ShapeDtypeStruct(leaf.shape[1:], leaf.dtype)] * leaf.shape[0]
    return list(leaf)
