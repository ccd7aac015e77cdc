"""Gaussians as PLY files in the standard 3D-Gaussian-splatting layout (Kerbl et al. 2023); reads compressed ones too.

Standard layout, binary little-endian float32: x y z · nx ny nz (zero unless given) · f_dc_0..2 · f_rest_* (channel
after channel) · opacity (logit) · scale_0..2 (natural logarithm) · rot_0..3 (w x y z). f_dc is (rgb - 0.5) /
0.28209479.

Far from the world's origin float32 has no millimetres left (at a UTM northing of 5.6e6 m its steps are half a metre).
Such sets carry their place as float64 in a line of the header, `comment offset x y z`: world = offset + (x, y, z).
"""

from __future__ import annotations

from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Float64

from aerojax.core.errors import UserError
from aerojax.core.files import write_bytes
from aerojax.core.types import Gaussians
from aerojax.gaussians.io.compressed_ply import decode
from aerojax.gaussians.io.placement import FAR, refuse_far
from aerojax.gaussians.io.ply_elements import PlyFile, read_elements
from aerojax.gaussians.sh import COEFFICIENTS

SMALLEST_SCALE = 1e-12
"""Metres; zero has no logarithm."""
OPACITY_MARGIN = 1e-6
"""Opacities are written at least this far from 0 and 1, whose logits are infinite; the format's float32 keeps it."""
OFFSET = "offset"
"""First word of the comment that says where the positions' origin lies in the world."""
FILTER = "filter_3D"
"""Mip-Splatting's property: standard deviation of the 3D smoothing filter, metres (Yu et al. 2024, §4.1)."""


def write_ply(
    path: Path | str,
    gaussians: Gaussians,
    *,
    origin: Float64[np.ndarray, "3"] | None = None,
    normal: Float[np.ndarray, "gaussian 3"] | None = None,
) -> None:
    """Write one set of Gaussians; quaternions are normalised, colour of degree 0 to 3 is kept as it is.

    The frame is the Gaussians' own (aerojax's world has +Z up; many viewers expect -Y up and offer a rotation).

    Args:
        path: ends with `.ply`; an existing file is replaced.
        gaussians: one set, no batch axes, finite.
        origin: where the Gaussians' origin lies in the world, metres; written to the header unless it is None or zero.
        normal: of the surface at each Gaussian, for those who know it; zero if None.

    Raises:
        UserError: if there are batch axes, or an attribute is not finite; names it.
    """
    arrays = {name: np.asarray(getattr(gaussians, name), np.float64) for name in gaussians.__dataclass_fields__}
    if arrays["mean"].ndim != 2:
        raise UserError(
            "invalid", f"{path}: a PLY file holds one set of Gaussians", f"got a batch of shape {gaussians.mean.shape}"
        )
    place = np.zeros(3) if origin is None else origin
    normal = np.zeros_like(arrays["mean"]) if normal is None else normal
    for name, array in {**arrays, "origin": place, "normal": normal}.items():
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
        normal,
        sh[:, 0],
        sh[:, 1:].transpose(0, 2, 1).reshape(len(sh), 3 * (sh.shape[1] - 1)),
        np.log(opacity / (1 - opacity))[:, None],
        np.log(np.maximum(arrays["scale"], SMALLEST_SCALE)),
        quaternion,
    ]
    lines = ["ply", "format binary_little_endian 1.0", "comment metres; frame as given, +Z up for aerojax worlds"]
    if np.any(place):
        lines += [f"comment {OFFSET} " + " ".join(repr(float(x)) for x in place)]
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

    Ascii and binary files of either byte order are read. Properties may come in any order and any scalar type; unknown
    ones and other elements are passed over. A `filter_3D` of Mip-Splatting is folded into scales and opacities. An
    infinite logit is opacity 0 or 1, a scale of log 0 is 0; every other number must be finite.

    Raises:
        UserError: the file is missing, is no PLY, contradicts its header, lacks a property or has one twice, or holds
            numbers that are not finite: names it. Or it lies so far from the origin that float32 would round
            millimetres away; `read_placed_ply` reads it.
    """
    gaussians, origin = read_placed_ply(path)
    refuse_far(path, origin, "read_placed_ply")
    return gaussians


def read_placed_ply(path: Path | str) -> tuple[Gaussians, Float64[np.ndarray, "3"]]:
    """Read Gaussians as `read_ply` does, and where their origin lies in the world.

    Returns:
        The Gaussians, and their origin in metres: world = origin + mean. It is the file's own offset, and, where
        positions in double precision lie farther than `FAR` from zero, their rounded middle.

    Raises:
        UserError: as `read_ply`, but for distance; or the header's offset is no three finite numbers.
    """
    path = Path(path)
    found = read_elements(path)
    if "chunk" in found.columns:
        columns = decode(found.columns, str(path))
    elif "vertex" in found.columns:
        if lists := found.elements["vertex"].lists:
            raise UserError(
                "invalid",
                f"{path}: vertex properties {', '.join(lists)} are lists",
                "Gaussian-splat files hold scalars; this is not one",
            )
        columns = found.columns["vertex"]
    else:
        raise UserError("invalid", f"{path}: no element 'vertex'", "this is not a Gaussian-splat PLY")
    columns, middle = _near_zero(columns)
    gaussians = _from_columns(columns, path)
    return gaussians, _offset(found, path) + middle


def _offset(found: PlyFile, path: Path) -> Float64[np.ndarray, "3"]:
    """The place that the header gives."""
    lines = [words[1:] for words in map(str.split, found.comments) if words[:1] == [OFFSET]]
    if not lines:
        return np.zeros(3)
    try:
        values = np.array([float(word) for word in lines[0]])
    except ValueError:
        values = np.zeros(0)
    if len(lines) > 1 or values.shape != (3,) or not np.all(np.isfinite(values)):
        raise UserError("invalid", f"{path}: 'comment {OFFSET}' must be there once, with three numbers", "correct it")
    return values


def _near_zero(columns: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], Float64[np.ndarray, "3"]]:
    """Positions about their middle where float32 would round those of a file in double precision."""
    axes = [columns[name] for name in "xyz" if name in columns]
    wide = len(axes) == 3 and all(x.dtype == np.float64 and x.size and np.all(np.isfinite(x)) for x in axes)
    if not wide or max(np.abs(x).max() for x in axes) <= FAR:
        return columns, np.zeros(3)
    middle = np.round([x.min() / 2 + x.max() / 2 for x in axes])
    moved = {name: x - shift for name, x, shift in zip("xyz", axes, middle, strict=True)}
    return {**columns, **moved}, middle


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
    with np.errstate(over="ignore"):  # an infinite scale is refused below
        scale = np.exp(stack("scale_0", "scale_1", "scale_2"))
    opacity = 1 / (1 + np.exp(-np.clip(columns["opacity"].astype(np.float64), -80, 80)))
    scale, opacity = _smoothed(scale, opacity, columns.get(FILTER), path)
    arrays = {
        "x, y, z": stack("x", "y", "z"),
        "rot_0..3": stack("rot_0", "rot_1", "rot_2", "rot_3"),
        "scale_0..2": scale,
        "opacity": opacity,
        "f_dc, f_rest": np.concatenate([stack("f_dc_0", "f_dc_1", "f_dc_2")[:, None], higher], axis=1),
    }
    with np.errstate(over="ignore"):
        single = {name: values.astype(np.float32) for name, values in arrays.items()}
    for name, values in single.items():
        if wrong := int((~np.isfinite(values)).reshape(count, -1).any(axis=1).sum()) if count else 0:
            raise UserError(
                "invalid", f"{path}: {name} of {wrong} of {count} Gaussians are not finite", "drop those Gaussians"
            )
    return Gaussians(*(jnp.asarray(values) for values in single.values()))


def _smoothed(
    scale: np.ndarray, opacity: np.ndarray, width: np.ndarray | None, path: Path
) -> tuple[np.ndarray, np.ndarray]:
    """Scales and opacities under Mip-Splatting's 3D smoothing filter (Yu et al. 2024, Eq. 9).

    s' = √(s² + w²) along each axis; the peak falls by √(|Σ| / |Σ + w² I|) = Π s / s', which keeps the energy.
    """
    if width is None:
        return scale, opacity
    width = width.astype(np.float64)
    if not np.all(np.isfinite(width) & (width >= 0)):
        raise UserError("invalid", f"{path}: {FILTER} must be finite and not negative", "export it again")
    wider = np.hypot(scale, width[:, None])
    ratio = np.divide(scale, wider, out=np.ones_like(scale), where=(wider > 0) & np.isfinite(wider))
    return wider, opacity * np.prod(ratio, axis=1)
