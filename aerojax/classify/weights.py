"""Trained models on disk: safetensors with the configuration in the header, read strictly."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.released.tensor_names import parameter_paths
from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError

CONFIG_KEY = "mambasplat_config"


def save_weights(path: Path, model: MambaSplat, metadata: Mapping[str, str] | None = None) -> None:
    """Write a model's parameters; the file is complete or absent, never half written.

    Args:
        path: the file to write, usually `*.safetensors`; its folder must exist.
        model: any variant.
        metadata: further header entries, such as class names or the run that made the weights.
    """
    tensors = {name: np.ascontiguousarray(np.asarray(leaf)) for name, leaf in parameter_paths(model)}
    header = dict(metadata or {}) | {CONFIG_KEY: json.dumps(dataclasses.asdict(model.config), sort_keys=True)}
    partial = path.with_name(path.name + ".partial")
    save_file(tensors, partial, metadata=header)
    partial.replace(path)


def load_weights(path: Path) -> MambaSplat:
    """Read a model that `save_weights` wrote.

    Raises:
        UserError: if the file is absent or broken, its header has no configuration, or any tensor is missing, unknown
            or of another shape.
    """
    tensors, header = _read(path)
    if CONFIG_KEY not in header:
        raise UserError(
            "missing", f"{path} has no {CONFIG_KEY} in its header", "write weights with aerojax.classify.weights"
        )
    config = to_dataclass(json.loads(header[CONFIG_KEY]), MambaSplatConfig, source=str(path))
    shapes = jax.eval_shape(lambda key: MambaSplat(config, key=key), jax.random.key(0))
    expected = {name: leaf.shape for name, leaf in parameter_paths(shapes)}
    problems = [f"missing tensor {name}" for name in expected if name not in tensors]
    problems += [f"unknown tensor {name}" for name in tensors if name not in expected]
    problems += [
        f"tensor {name} has shape {tensors[name].shape}, expected {shape}"
        for name, shape in expected.items()
        if name in tensors and tensors[name].shape != shape
    ]
    if problems:
        raise UserError(
            "invalid",
            f"{path} does not fit its own configuration; train again or fetch the file anew:\n  "
            + "\n  ".join(problems),
        )
    return jax.tree.unflatten(jax.tree.structure(shapes), [jnp.asarray(tensors[name]) for name in expected])


def load_metadata(path: Path) -> dict[str, str]:
    """The further header entries that `save_weights` was given.

    Raises:
        UserError: if the file is absent or broken.
    """
    return {key: value for key, value in _read(path)[1].items() if key != CONFIG_KEY}


def _read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    if not path.is_file():
        raise UserError("missing", f"weights file {path} does not exist", "train a model or correct the path")
    try:
        with safe_open(path, framework="numpy") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except SafetensorError as error:
        raise UserError(
            "unreadable", f"{path} is not a complete safetensors file ({error})", "fetch or write it again"
        ) from None
