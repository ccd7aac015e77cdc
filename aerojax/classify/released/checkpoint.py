"""Checkpoints of the released PyTorch code as models: read strictly, the configuration taken from the shapes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerojax.classify.mambasplat.config import MambaSplatConfig, Mode, published_config
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.released.tensor_names import COMPILED_PREFIX, POSITIONS, is_unused, model_from_published
from aerojax.core.errors import UserError
from aerojax.core.torch_files import read_state_dict

HEADS = 4
"""Attention heads of every released model; the shapes hold only heads times width."""
BIAS_EPSILON = 1e-6

_LIFT = ("spatial_encoder.input_proj.vn_linear.weight", "spatial_encoder.input_proj.proj.1.weight")
"""Map of position, scales and rotation to channels; of the position alone."""
_QUERY = "spatial_encoder.encoder.layers.0.0.to_q."
_TELLING = {
    "query": (_QUERY + "weight", 2),
    "bridge": ("temporal_encoder.bridge.proj.0.weight", 2),
    "decay": ("temporal_encoder.mamba.layers.0.mixer.A_log", 2),
    "convolution": ("temporal_encoder.mamba.layers.0.mixer.conv1d.weight", 3),
    "answer": ("classifier.classifier.3.weight", 2),
    "positions": (POSITIONS, 3),
}
"""Tensors whose shapes tell the configuration, with their number of axes."""
_MODES: dict[tuple[bool, int], Mode] = {
    (False, 0): "C",
    (False, 1): "C_O",
    (False, 3): "C_SH",
    (True, 0): "C_S_R",
    (True, 1): "C_O_S_R",
    (True, 4): "X",
}
"""Mode by whether scales and rotations are read, and the number of invariant slots."""


@dataclass(frozen=True, eq=False)
class ImportedCheckpoint:
    """A released model, of the published variant, and the names of stored tensors that it has no use for."""

    model: MambaSplat
    unused: tuple[str, ...]


def import_checkpoint(path: Path, *, heads: int = HEADS) -> ImportedCheckpoint:
    """Read a state dict that the released code saved (`best_model.pt`, `final_model.pt`, `epoch_50.pt`).

    Args:
        path: the `.pt` file; names may carry the prefix of compiled training.
        heads: of the attention.

    Raises:
        UserError: the file cannot be read (see `read_torch`), or names every tensor that is missing, unknown, of
            another shape or not finite.
    """
    tensors: dict[str, np.ndarray] = {}
    problems = []
    for stored, value in read_state_dict(path).items():
        name = stored.removeprefix(COMPILED_PREFIX)
        if name in tensors:
            problems.append(f"tensor {name} is there twice, with and without {COMPILED_PREFIX}")
        elif not np.all(np.isfinite(value)):
            problems.append(f"tensor {name} holds numbers that are not finite")
        tensors[name] = value.astype(np.float32)
    try:
        if problems:
            raise UserError("invalid", "tensors cannot be used:\n  " + "\n  ".join(problems))
        model = model_from_published(tensors, infer_config(tensors, heads=heads))
    except UserError as error:
        raise UserError("invalid", f"{path}: {error}") from None
    return ImportedCheckpoint(model, tuple(sorted(name for name, value in tensors.items() if is_unused(name, value))))


def infer_config(tensors: Mapping[str, np.ndarray], *, heads: int = HEADS) -> MambaSplatConfig:
    """The configuration that a released state dict was trained with, from its shapes.

    Args:
        tensors: without the prefix of compiled training.
        heads: of the attention.

    Raises:
        UserError: tensors that tell the sizes are missing or of another number of axes, all named; or the sizes belong
            to no mode.
    """
    shapes, problems = _telling_shapes(tensors)
    if problems:
        raise UserError("invalid", "no model of the released code:\n  " + "\n  ".join(problems))
    channels, vectors = shapes["lift"]
    width, features = shapes["bridge"]
    inner, states = shapes["decay"]
    slots, rest = divmod(features - 3 * channels, channels)
    mode = _MODES.get((vectors == 4, slots))
    if rest or mode is None or vectors not in (1, 4) or shapes["query"][0] % heads or inner % width:
        sizes = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise UserError(
            "invalid",
            f"the sizes belong to no model of the released code with {heads} heads: {sizes}",
            "name a checkpoint of the released code",
        )
    return published_config(
        mode,
        channels=channels,
        heads=heads,
        head_dim=shapes["query"][0] // heads,
        depth=_count(tensors, "spatial_encoder.encoder.layers."),
        d_model=width,
        mamba_layers=_count(tensors, "temporal_encoder.mamba.layers."),
        d_state=states,
        d_conv=shapes["convolution"][2],
        expand=inner // width,
        classes=shapes["answer"][0],
        bias_epsilon=BIAS_EPSILON if _QUERY + "bias" in tensors else 0.0,
    )


def _telling_shapes(tensors: Mapping[str, np.ndarray]) -> tuple[dict[str, tuple[int, ...]], list[str]]:
    lift = next((name for name in _LIFT if name in tensors), _LIFT[0])
    shapes, problems = {}, []
    for key, (name, axes) in {"lift": (lift, 2), **_TELLING}.items():
        if name not in tensors:
            problems.append(f"missing tensor {name}")
        elif tensors[name].ndim != axes or not tensors[name].size:
            problems.append(f"tensor {name} has shape {tensors[name].shape}, expected {axes} axes")
        else:
            shapes[key] = tensors[name].shape
    return shapes, problems


def _count(tensors: Mapping[str, np.ndarray], prefix: str) -> int:
    """One more than the largest index behind `prefix`; a hole in between shows as missing tensors."""
    found = (re.match(re.escape(prefix) + r"(\d{1,3})\.", name) for name in tensors)
    return 1 + max(int(match[1]) for match in found if match)
