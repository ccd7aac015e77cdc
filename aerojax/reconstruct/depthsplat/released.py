"""Published weights as members: DepthSplat's encoder whole, or Depth-Anything-V2 ViT-S as its monocular branch."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import jax
import numpy as np
from jaxtyping import Array, Key

from aerojax.core.errors import UserError
from aerojax.core.tensors import read_tensors
from aerojax.core.torch_files import read_torch
from aerojax.reconstruct.depthsplat.config import DepthSplatConfig
from aerojax.reconstruct.depthsplat.gaussians import COLOUR
from aerojax.reconstruct.depthsplat.reconstructor import DepthSplat, untrained_depthsplat
from aerojax.reconstruct.depthsplat.tensor_names import MONOCULAR, network_from_published, published_tensors

ENCODER = "encoder."
"""In front of the encoder's names in files of whole training runs."""
ALONE = "pretrained."
"""In front of the names of a monocular branch that is stored alone."""
UNUSED = ("mask_token",)
"""Last words of tensors that only pre-training needs."""
_CANDIDATES = "depth_predictor.depth_head.0.2.weight"
_COLOURS = "gaussian_head.2.weight"


@dataclass(frozen=True, eq=False)
class ImportedDepthSplat:
    """A member with published weights.

    config: what the file's shapes say of it.
    kind: whether the file held the whole encoder or the monocular branch; the rest is random then.
    unused: names of stored tensors that the network has no place for.
    """

    reconstructor: DepthSplat
    config: DepthSplatConfig
    kind: Literal["encoder", "monocular"]
    unused: tuple[str, ...]


def import_depthsplat(path: Path, config: DepthSplatConfig, *, key: Key[Array, ""]) -> ImportedDepthSplat:
    """Read a file of DepthSplat or of Depth-Anything-V2 ViT-S.

    Args:
        path: safetensors, or a file of `torch.save`, of which nothing is run.
        config: the geometry to use the weights with; the number of candidates and the degree of the colours are taken
            from the file.
        key: of the parts that the file does not hold.

    Raises:
        UserError: the file cannot be read; or names every tensor that is missing, unknown, of another shape or not
            finite.
    """
    tensors = _read(path)
    kind: Literal["encoder", "monocular"] = "encoder"
    if any(name.startswith(ALONE) for name in tensors):
        kind = "monocular"
        mine = {MONOCULAR + name.removeprefix(ALONE): v for name, v in tensors.items() if name.startswith(ALONE)}
    else:
        encoder = any(name.startswith(ENCODER) for name in tensors)
        mine = {n.removeprefix(ENCODER): v for n, v in tensors.items() if n.startswith(ENCODER) or not encoder}
        config = _sized(config, mine)
    used = {name: value for name, value in mine.items() if name.rpartition(".")[2] not in UNUSED}
    shapes = jax.eval_shape(lambda key: untrained_depthsplat(config, key=key), jax.random.key(0))
    expected = published_tensors(shapes.network)
    if kind == "monocular":
        expected = {name: shape for name, shape in expected.items() if name.startswith(MONOCULAR)}
    if problems := _problems(used, expected):
        raise UserError("invalid", "\n  ".join([f"{path} is no {_NAMES[kind]}:", *problems]), "name another file")
    used = {name: value.astype(np.float32) for name, value in used.items()}
    if kind == "encoder":
        network = network_from_published(used, shapes.network)
    else:
        network = untrained_depthsplat(config, key=key).network
        drawn = {name: np.asarray(value) for name, value in published_tensors(network).items()}
        network = network_from_published(drawn | used, network)
    kept = {_stored(name, kind, tensors) for name in used}
    unused = tuple(sorted(name for name in tensors if name not in kept))
    return ImportedDepthSplat(DepthSplat(network, config), config, kind, unused)


_NAMES = {"encoder": "encoder of DepthSplat-small at one scale", "monocular": "ViT-S of Depth-Anything-V2"}


def _read(path: Path) -> dict[str, np.ndarray]:
    if path.suffix == ".safetensors":
        return read_tensors(path)[0]
    content: Any = read_torch(path)
    if isinstance(content, Mapping) and isinstance(content.get("state_dict"), Mapping):
        content = content["state_dict"]
    if not isinstance(content, Mapping) or not all(isinstance(value, np.ndarray) for value in content.values()):
        raise UserError("unreadable", f"{path} holds no tensors by name", "give a state dict, alone or of a whole run")
    return {str(name): value for name, value in content.items()}


def _sized(config: DepthSplatConfig, tensors: Mapping[str, np.ndarray]) -> DepthSplatConfig:
    """With the sizes that the file says; what else is wrong is named later."""
    if _CANDIDATES in tensors and tensors[_CANDIDATES].ndim == 4:
        config = dataclasses.replace(config, candidates=max(tensors[_CANDIDATES].shape[0], 2))
    if _COLOURS in tensors and tensors[_COLOURS].ndim == 4:
        coefficients = max(tensors[_COLOURS].shape[0] - COLOUR, 3) // 3
        config = dataclasses.replace(config, sh_degree=min(math.isqrt(coefficients) - 1, 3))
    return config


def _problems(tensors: Mapping[str, np.ndarray], expected: Mapping[str, jax.ShapeDtypeStruct]) -> list[str]:
    """Everything for which the tensors are not the expected ones, in words."""
    problems = [f"missing tensor {name}" for name in expected if name not in tensors]
    for name, value in tensors.items():
        if name not in expected:
            problems.append(f"unknown tensor {name}")
        elif value.shape != tuple(expected[name].shape):
            problems.append(f"tensor {name} has shape {value.shape}, expected {tuple(expected[name].shape)}")
        elif not np.isfinite(value).all():
            problems.append(f"tensor {name} holds numbers that are not finite")
    return problems


def _stored(name: str, kind: str, tensors: Mapping[str, np.ndarray]) -> str:
    """The name in the file of a tensor that was used."""
    if kind == "monocular":
        return ALONE + name.removeprefix(MONOCULAR)
    return ENCODER + name if ENCODER + name in tensors else name
