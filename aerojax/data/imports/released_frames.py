"""Frames of the released data as our 14 columns.

A released frame is normalised: positions in the unit ball about the mean of all its Gaussians, opacity 2a-1, colour
2·clip(C0·f_dc, ±½)/√3, and scales divided by the ball's radius and then by the frame's largest scale vector. Opacity is
inverted exactly and colour too, except where it was clipped. Position and the second factor of the scales are not
stored, so metres are lost, and with them how large the splats are beside the object; their shapes are exact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int, Key

from aerojax.core.errors import UserError
from aerojax.core.torch_files import read_torch
from aerojax.core.types import CLASSES, SH_C0, Gaussians
from aerojax.data.imports.released_layout import FrameSequence
from aerojax.gaussians.decimate import DecimationConfig, decimate
from aerojax.gaussians.io.ply import read_ply

COLOUR_FROM_PUBLISHED = 3**0.5 / (2 * SH_C0)
"""f_dc of a released colour, 2·C0·f_dc/√3."""
_RAW = {"position": 3, "quaternion": 4, "scale": 3, "opacity": 1, "sh_dc": 3}
"""Entries of a raw frame and their widths; opacity in 0..1, scale linear."""


@dataclass(frozen=True)
class FrameReading:
    """How files become frames of a clip.

    version: which of a preprocessed file's random subsets.
    tokens: kept of a frame.
    decimation: of plain Gaussians.
    """

    version: int
    tokens: int
    decimation: DecimationConfig

    def __post_init__(self) -> None:
        """Refuse what no file has.

        Raises:
            UserError: names both fields.
        """
        if self.version < 0 or self.tokens < 1:
            problem = f"version {self.version} must be at least 0 and tokens {self.tokens} at least 1"
            raise UserError("out-of-range", problem, "correct them")


def columns_from_published(columns: Float[np.ndarray, "*batch token 14"]) -> Float32[np.ndarray, "*batch token 14"]:
    """Undo the released normalisation as far as it can be undone; see the module."""
    result = np.array(columns, np.float32)
    result[..., 10] = np.clip((result[..., 10] + 1) / 2, 0, 1)
    result[..., 11:] *= COLOUR_FROM_PUBLISHED
    return result


def read_sequence(
    sequence: FrameSequence, reading: FrameReading, *, key: Key[Array, ""]
) -> Float32[np.ndarray, "time token 14"]:
    """The clip of a sequence.

    Raises:
        UserError: names every file that is broken, of another shape or class, not finite, or short of tokens.
    """
    frames, problems = [], []
    for index, file in enumerate(sequence.files):
        try:
            if sequence.preprocessed:
                columns = _preprocessed(file, sequence.label, reading.version)
            else:
                columns = decimated_columns(read_gaussians(file), reading.decimation, jax.random.fold_in(key, index))
            if len(columns) < reading.tokens:
                raise UserError(
                    "invalid", f"{file} gives {len(columns)} tokens, {reading.tokens} are asked for", "set tokens"
                )
            frames.append(columns[: reading.tokens])
        except UserError as error:
            problems.append(str(error))
    if problems:
        raise UserError("invalid", "\n  ".join(problems))
    return np.stack(frames)


def _preprocessed(file: Path, label: str, version: int) -> Float32[np.ndarray, "token 14"]:
    content = read_torch(file)
    versions = content.get("versions") if isinstance(content, dict) else None
    if not isinstance(versions, np.ndarray) or versions.ndim != 3 or versions.shape[2] != 14:
        raise UserError("missing", f"{file} holds no `versions` of shape (version, token, 14)", "preprocess it again")
    if version >= len(versions):
        raise UserError(
            "invalid", f"{file} has {len(versions)} versions, version {version} is asked for", "ask for one of them"
        )
    named = content.get("class_name", label), content.get("label", CLASSES.index(label))
    if named[0] != label:
        raise UserError(
            "out-of-range",
            f"{file} says class {named[0]!r} (label {named[1]!r}) but lies in a folder of {label}",
            "move it or set the label",
        )
    columns = versions[version]
    if not np.all(np.isfinite(columns)) or np.abs(columns[:, 10]).max(initial=0) > 1 + 1e-4:
        raise UserError("unreadable", f"{file}: numbers are not finite, or opacity leaves -1..1", "preprocess it again")
    return columns_from_published(columns.astype(np.float32))


def read_gaussians(file: Path) -> Gaussians:
    """Gaussians of a PLY file or of a raw `.pt`; at least one, all finite.

    Raises:
        UserError: the file is broken, empty or holds numbers that are not finite; names it.
    """
    gaussians = read_ply(file) if file.suffix == ".ply" else _raw(file, read_torch(file))
    if not len(gaussians.mean):
        raise UserError("missing", f"{file} holds no Gaussians", "leave it out")
    columns = np.asarray(gaussians.columns())
    if not np.all(np.isfinite(columns)):
        raise UserError(
            "unreadable", f"{file}: {np.sum(~np.isfinite(columns).all(axis=1))} Gaussians are not finite", "remove them"
        )
    return gaussians


def _raw(file: Path, content: object) -> Gaussians:
    parts = content if isinstance(content, Mapping) else {}
    arrays = [parts.get(name) for name in _RAW]
    count = len(arrays[0]) if isinstance(arrays[0], np.ndarray) and arrays[0].ndim else 0
    fits = [isinstance(a, np.ndarray) and a.shape == (count, n) for a, n in zip(arrays, _RAW.values(), strict=True)]
    if not all(fits):
        wrong = [f"{name} (n, {width})" for (name, width), right in zip(_RAW.items(), fits, strict=True) if not right]
        raise UserError("invalid", f"{file} lacks or misshapes {', '.join(wrong)}", "reconstruct it again")
    position, quaternion, scale, opacity, colour = (jnp.asarray(a, jnp.float32) for a in arrays)
    return Gaussians(position, quaternion, scale, opacity[:, 0], colour[:, None])


def decimated_columns(
    gaussians: Gaussians, config: DecimationConfig, key: Key[Array, ""]
) -> Float32[np.ndarray, "token 14"]:
    """Columns of `decimate`d Gaussians; padded to powers of two with repeats, so that few sizes are compiled."""
    columns = np.asarray(gaussians.columns())
    count = len(columns)
    padded = columns[np.arange(1 << (count - 1).bit_length()) % count]
    return np.asarray(_decimate(jnp.asarray(padded), jnp.asarray(count), key, config))


@partial(jax.jit, static_argnames="config")
def _decimate(
    columns: Float[Array, "gaussian 14"], count: Int[Array, ""], key: Key[Array, ""], config: DecimationConfig
) -> Float[Array, "token 14"]:
    return decimate(Gaussians.from_columns(columns), key=key, config=config, count=count).columns()
