"""The released model's tensor names beside ours, in both directions.

A published state dict also holds a second bridge that its model never calls, norm offsets that stay zero, and the table
of positions; those have no place in `MambaSplat`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.classify.mambasplat.config import MambaSplatConfig, uses_shape
from aerojax.classify.mambasplat.mamba import sinusoids
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.core.errors import UserError
from aerojax.core.tensors import parameter_names

COMPILED_PREFIX = "_orig_mod."
UNUSED_BRIDGE = "bridge."
POSITIONS = "temporal_encoder.pos_encoder.pe"
HALF_STEP = 4e-3
"""Rounding of numbers up to 1 in bfloat16; another table of positions differs by far more."""
POOL = "spatial_encoder.classifier_head.global_pool.weight"

_BLOCK = {
    **{f"attention.to_{n}.{t}": f"0.to_{n}.{t}" for n in ("q", "k", "v", "out") for t in ("weight", "bias")},
    **{
        f"feed_forward.{ours}.{t}": f"2.{i}.{t}"
        for ours, i in (("widen", 0), ("narrow", 2))
        for t in ("weight", "bias")
    },
    "attention_norm.gain": "1.ln.gamma",
    "feed_forward.rectify.W": "2.1.W",
    "feed_forward.rectify.U": "2.1.U",
    "feed_forward_norm.gain": "3.ln.gamma",
}
_LAYER = {
    "norm.weight": "norm.weight",
    "norm.bias": "norm.bias",
    "mixer.in_proj.weight": "mixer.in_proj.weight",
    "mixer.conv_weight": "mixer.conv1d.weight",
    "mixer.conv_bias": "mixer.conv1d.bias",
    "mixer.x_proj.weight": "mixer.x_proj.weight",
    "mixer.dt_weight": "mixer.dt_proj.weight",
    "mixer.dt_bias": "mixer.dt_proj.bias",
    "mixer.A_log": "mixer.A_log",
    "mixer.D": "mixer.D",
    "mixer.out_proj.weight": "mixer.out_proj.weight",
}
_BRIDGE = {
    "frame.linear_0.weight": "frame_mlp.0.weight",
    "frame.rectify_0.W": "frame_mlp.1.W",
    "frame.rectify_0.U": "frame_mlp.1.U",
    "frame.linear_1.weight": "frame_mlp.2.weight",
    "frame.rectify_1.W": "frame_mlp.3.W",
    "frame.rectify_1.U": "frame_mlp.3.U",
    "frame.linear_2.weight": "frame_mlp.4.weight",
    "linear.weight": "proj.0.weight",
    "linear.bias": "proj.0.bias",
    "norm.weight": "proj.2.weight",
    "norm.bias": "proj.2.bias",
}
_SINGLE = {
    "encoder.norm.gain": "spatial_encoder.encoder.norm.ln.gamma",
    "pool.weight": POOL,
    "temporal.norm.weight": "temporal_encoder.mamba.norm_f.weight",
    "temporal.norm.bias": "temporal_encoder.mamba.norm_f.bias",
    "head.hidden.weight": "classifier.classifier.0.weight",
    "head.hidden.bias": "classifier.classifier.0.bias",
    "head.out.weight": "classifier.classifier.3.weight",
    "head.out.bias": "classifier.classifier.3.bias",
}
_STACKS = {
    "encoder.blocks.": ("spatial_encoder.encoder.layers.", _BLOCK),
    "temporal.layers.": ("temporal_encoder.mamba.layers.", _LAYER),
}


def _published_names(path: str, leaf: Any, config: MambaSplatConfig) -> list[str]:
    """The published name of one of our leaves; one name a layer for stacked leaves."""
    for prefix, (published, names) in _STACKS.items():
        if path.startswith(prefix):
            return [f"{published}{layer}.{names[path.removeprefix(prefix)]}" for layer in range(leaf.shape[0])]
    if path.startswith("bridge."):
        return ["temporal_encoder.bridge." + _BRIDGE[path.removeprefix("bridge.")]]
    if path.startswith("lifting.linear."):
        layer = "vn_linear" if uses_shape(config.mode) else "proj.1"
        return [f"spatial_encoder.input_proj.{layer}.{path.removeprefix('lifting.linear.')}"]
    return [_SINGLE[path]]


def _to_published(name: str, value: Any) -> Any:
    if name == POOL:
        return value.T[None]
    return value[:, None, :] if name.endswith("conv1d.weight") else value


def _from_published(name: str, value: Any) -> Any:
    if name == POOL:
        return value[0].T
    return value[:, 0, :] if name.endswith("conv1d.weight") else value


def published_tensors(model: MambaSplat) -> dict[str, Any]:
    """The model's parameters (or the gradient's) under the released names, without the parts that are never used.

    Raises:
        UserError: if the model is not of the published variant.
    """
    if model.config.variant != "published":
        raise UserError(
            "out-of-range", "variant is 'exact' in this model", "only variant 'published' has released tensor names"
        )
    tensors: dict[str, Any] = {}
    for path, leaf in parameter_names(model):
        names = _published_names(path, leaf, model.config)
        values = leaf if path.startswith(tuple(_STACKS)) else leaf[None]
        tensors |= {name: _to_published(name, value) for name, value in zip(names, values, strict=True)}
    return tensors


def model_from_published(tensors: Mapping[str, np.ndarray], config: MambaSplatConfig) -> MambaSplat:
    """Build the published variant from a released state dict.

    Args:
        tensors: name → array; the prefix of compiled training is accepted.
        config: as `published_config` makes it, with the sizes that the tensors were trained with.

    Raises:
        UserError: names every tensor that is missing, unknown or of another shape.
    """
    given = {name.removeprefix(COMPILED_PREFIX): value for name, value in tensors.items()}
    shapes = jax.eval_shape(lambda key: MambaSplat(config, key=key), jax.random.key(0))
    leaves, wanted, problems = [], set[str](), list[str]()
    for path, leaf in parameter_names(shapes):
        stacked = path.startswith(tuple(_STACKS))
        shape = leaf.shape[1:] if stacked else leaf.shape
        names = _published_names(path, leaf, config)
        wanted |= set(names)
        found = [_take(given, name, shape, problems) for name in names]
        leaves.append(np.stack(found) if stacked else found[0])
    problems += [_why_unknown(name) for name in sorted(set(given) - wanted) if not is_unused(name, given[name])]
    if problems:
        raise UserError("invalid", "tensors do not fit MambaSplatConfig:\n  " + "\n  ".join(problems))
    return jax.tree.unflatten(jax.tree.structure(shapes), [jnp.asarray(leaf) for leaf in leaves])


def _take(given: Mapping[str, np.ndarray], name: str, shape: tuple[int, ...], problems: list[str]) -> np.ndarray:
    if name not in given:
        problems.append(f"missing tensor {name}")
        return np.zeros(shape, np.float32)
    expected = _to_published(name, np.zeros(shape, np.float32)).shape
    if given[name].shape != expected:
        problems.append(f"tensor {name} has shape {given[name].shape}, expected {expected}")
        return np.zeros(shape, np.float32)
    return _from_published(name, given[name])


def is_unused(name: str, value: np.ndarray) -> bool:
    """Whether a stored tensor cannot change the output: unused bridge, zero offsets, the usual table of positions."""
    if name == POSITIONS:
        usual = value.ndim == 3 and len(value) == 1 and value.shape[2] % 2 == 0
        return usual and bool(np.allclose(value[0], sinusoids(value.shape[1], value.shape[2]), atol=HALF_STEP))
    return name.startswith(UNUSED_BRIDGE) or (name.endswith("ln.beta") and not value.any())


def _why_unknown(name: str) -> str:
    if name == POSITIONS:
        return f"tensor {name} is not the usual table of sinusoids"
    return f"tensor {name} is not zero" if name.endswith("ln.beta") else f"unknown tensor {name}"
