"""Gaussians as PLY files in the standard 3D-Gaussian-splatting layout (Kerbl et al. 2023); reads compressed ones too.

Standard layout, binary little-endian float32: x y z · nx ny nz (zero) · f_dc_0..2 · f_rest_* (channel after channel) ·
opacity (logit) · scale_0..2 (natural logarithm) · rot_0..3 (w x y z). f_dc is (rgb - 0.5) / 0.28209479.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from aerojax.core.errors import UserError
from aerojax.core.files import write_bytes
from aerojax.core.types import Gaussians
from aerojax.gaussians.io.compressed_ply import decode
from aerojax.gaussians.sh import COEFFICIENTS

NUMBERS = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "<i2",
    "int16": "<i2",
    "ushort": "<u2",
    "uint16": "<u2",
    "int": "<i4",
    "int32": "<i4",
    "uint": "<u4",
    "uint32": "<u4",
    "float": "<f4",
    "float32": "<f4",
    "double": "<f8",
    "float64": "<f8",
}
"""PLY's names of scalar types, little-endian."""

SMALLEST_SCALE = 1e-12
"""Metres; zero has no logarithm."""
OPACITY_MARGIN = 1e-6
"""Opacities are written at least this far from 0 and 1, whose logits are infinite; the format's float32 keeps it."""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    dtype: np.dtype


def write_ply(path: Path | str, gaussians: Gaussians) -> None:
    """Write one set of Gaussians; quaternions are normalised, colour of degree 0 to 3 is kept as it is.

    The frame is the Gaussians' own (aerojax's world has +Z up; many viewers expect -Y up and offer a rotation).

    Args:
        path: ends with `.ply`; an existing file is replaced.
        gaussians: one set, no batch axes, finite.

    Raises:
        UserError: if there are batch axes, or an attribute is not finite; names it.
    """
    arrays = {name: np.asarray(getattr(gaussians, name), np.float64) for name in gaussians.__dataclass_fields__}
    if arrays["mean"].ndim != 2:
        raise UserError(
            "invalid", f"{path}: a PLY file holds one set of Gaussians", f"got a batch of shape {gaussians.mean.shape}"
        )
    for name, array in arrays.items():
        if not np.all(np.isfinite(array)):
            raise UserError(
                "invalid",
                f"{path}: {name} has {int((~np.isfinite(array)).sum())} non-finite numbers",
                "drop those rows",
            )
    opacity = np.clip(arrays["opacity"], OPACITY_MARGIN, 1 - OPACITY_MARGIN)
    norm = np.linalg.norm(arrays["quaternion"], axis=1, keepdims=True)
    quaternion = np.where(norm > 0, arrays["quaternion"] / np.where(norm > 0, norm, 1), [1.0, 0, 0, 0])
    sh = arrays["sh"]
    columns = [
        arrays["mean"],
        np.zeros_like(arrays["mean"]),
        sh[:, 0],
        sh[:, 1:].transpose(0, 2, 1).reshape(len(sh), 3 * (sh.shape[1] - 1)),
        np.log(opacity / (1 - opacity))[:, None],
        np.log(np.maximum(arrays["scale"], SMALLEST_SCALE)),
        quaternion,
    ]
    lines = ["ply", "format binary_little_endian 1.0", "comment metres; frame as given, +Z up for aerojax worlds"]
    lines += [f"element vertex {len(sh)}", *(f"property float {name}" for name in property_names(sh.shape[1]))]
    header = "\n".join([*lines, "end_header\n"]).encode()
    write_bytes(Path(path), header + np.concatenate(columns, axis=1).astype("<f4").tobytes())


def property_names(coefficients: int) -> list[str]:
    """Names of the vertex properties in file order."""
    rest = [f"f_rest_{i}" for i in range(3 * (coefficients - 1))]
    return [
        *("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"),
        *rest,
        *("opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
    ]


def read_ply(path: Path | str) -> Gaussians:
    """Read Gaussians from a standard or a SuperSplat-compressed PLY file, in the frame and units of the file.

    Properties may come in any order and any scalar type; unknown ones are ignored.

    Raises:
        UserError: if the file is missing, is not a binary little-endian PLY, ends early or lacks a property; names it.
    """
    path = Path(path)
    if not path.is_file():
        raise UserError("missing", f"{path}: no such file", "correct the path")
    elements = _read_elements(path)
    if "chunk" in elements:
        columns = decode(elements, str(path))
    elif "vertex" in elements:
        columns = elements["vertex"]
    else:
        raise UserError("invalid", f"{path}: no element 'vertex'", "this is not a Gaussian-splat PLY")
    return _from_columns(columns, path)


def _read_elements(path: Path) -> dict[str, dict[str, np.ndarray]]:
    """Every element's properties as arrays, by name."""
    content = path.read_bytes()
    marker = content.find(b"end_header")
    if not content.startswith(b"ply") or marker < 0:
        raise UserError("unreadable", f"{path}: not a PLY file (no 'ply' … 'end_header')", "name a Gaussian-splat PLY")
    start = content.index(b"\n", marker) + 1
    lines = content[:marker].decode("ascii", "replace").splitlines()
    if "format binary_little_endian 1.0" not in (line.strip() for line in lines):
        raise UserError("invalid", f"{path}: only 'format binary_little_endian 1.0' is read", "convert the file first")
    elements = {}
    for element in _declared(lines, path):
        size = element.count * element.dtype.itemsize
        if start + size > len(content):
            raise UserError(
                "invalid",
                f"{path}: element '{element.name}' needs {size} bytes, {len(content) - start} are left",
                "copy it again, it is cut short",
            )
        rows = np.frombuffer(content, element.dtype, element.count, start)
        elements[element.name] = {name: rows[name] for name in element.dtype.names or ()}
        start += size
    return elements


def _declared(lines: list[str], path: Path) -> list[_Element]:
    declared: list[tuple[str, int, list[tuple[str, str]]]] = []
    for words in (line.split() for line in lines):
        if words[:1] == ["element"]:
            declared.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            if words[1] not in NUMBERS:
                raise UserError(
                    "unreadable",
                    f"{path}: property type '{words[1]}' is not a scalar",
                    "Gaussian-splat files hold none",
                )
            declared[-1][2].append((words[2], NUMBERS[words[1]]))
    return [_Element(name, count, np.dtype(fields)) for name, count, fields in declared]


def _from_columns(columns: dict[str, np.ndarray], path: Path) -> Gaussians:
    """Undo logarithm and logit; the number of f_rest columns gives the degree of the colour."""
    rest = sum(name.startswith("f_rest_") for name in columns)
    coefficients = 1 + rest // 3
    if rest % 3 or coefficients not in COEFFICIENTS:
        raise UserError("invalid", f"{path}: {rest} f_rest properties", "0, 9, 24 or 45 are degree 0 to 3")
    needed = [name for name in property_names(coefficients) if name not in ("nx", "ny", "nz")]
    missing = [name for name in needed if name not in columns]
    if missing:
        raise UserError(
            "invalid", f"{path}: vertex properties missing: {', '.join(missing)}", "this is not a Gaussian-splat PLY"
        )

    def stack(*names: str) -> np.ndarray:
        return np.stack([columns[name].astype(np.float64) for name in names], axis=-1)

    count = len(columns["x"])
    higher = np.zeros((count, 0, 3))
    if rest:
        flat = stack(*(f"f_rest_{i}" for i in range(rest)))
        higher = flat.reshape(count, 3, coefficients - 1).transpose(0, 2, 1)
    opacity = 1 / (1 + np.exp(-np.clip(columns["opacity"].astype(np.float64), -80, 80)))
    arrays = (
        stack("x", "y", "z"),
        stack("rot_0", "rot_1", "rot_2", "rot_3"),
        np.exp(stack("scale_0", "scale_1", "scale_2")),
        opacity,
        np.concatenate([stack("f_dc_0", "f_dc_1", "f_dc_2")[:, None], higher], axis=1),
    )
    return Gaussians(*(jnp.asarray(x, jnp.float32) for x in arrays))
