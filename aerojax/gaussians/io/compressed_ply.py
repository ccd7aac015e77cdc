"""SuperSplat's compressed PLY: 16 bytes a Gaussian, quantised between the bounds of its chunk of 256.

Element `chunk` holds bounds of position, log scale and (later versions) colour; element `vertex` four 32-bit words:
position 11-10-11 bits, rotation 2-10-10-10 (largest component dropped), log scale 11-10-11, colour and opacity 8-8-8-8.
An optional element `sh` holds the higher coefficients as bytes over [-4, 4].
"""

from __future__ import annotations

import numpy as np

from aerojax.core.errors import UserError
from aerojax.core.types import SH_C0

CHUNK = 256
POSITION_BITS = (11, 10, 11)
ROTATION_BITS = (2, 10, 10, 10)
COLOUR_BITS = (8, 8, 8, 8)


def decode(elements: dict[str, dict[str, np.ndarray]], source: str) -> dict[str, np.ndarray]:
    """The columns of the standard layout (logarithmic scale, logit opacity) from the compressed elements.

    Args:
        elements: arrays by element and property name.
        source: the file's name, for messages.

    Raises:
        UserError: an element or a property is missing or of another type, or chunks, vertices and coefficients do
            not match.
    """
    chunks, vertices = elements["chunk"], elements.get("vertex", {})
    words = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
    missing = [name for name in words if name not in vertices]
    missing += [f"{name} as uint" for name in words if name in vertices and vertices[name].dtype != np.uint32]
    bounded = ["x", "y", "z", *(f"scale_{axis}" for axis in "xyz"), *("rgb" if "min_r" in chunks else "")]
    missing += [f"{end}_{name}" for end in ("min", "max") for name in bounded if f"{end}_{name}" not in chunks]
    if missing:
        raise UserError("invalid", f"{source}: compressed PLY lacks {', '.join(missing)}", "export it again")
    count, bounds = len(vertices["packed_position"]), len(chunks["min_x"])
    if bounds != -(-count // CHUNK):
        raise UserError(
            "invalid",
            f"{source}: {count} vertices need {-(-count // CHUNK)} chunks of {CHUNK}",
            f"the file has {bounds}",
        )
    higher = elements.get("sh", {})
    if any(len(values) != count or values.dtype != np.uint8 for values in higher.values()):
        raise UserError("invalid", f"{source}: element 'sh' must hold {count} rows of uchar", "export it again")
    owner = np.arange(count) // CHUNK

    def between(values: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
        low, high = (
            np.stack([chunks[f"{end}_{name}"].astype(np.float64) for name in names], -1)[owner]
            for end in ("min", "max")
        )
        return low + values * (high - low)

    mean = between(_fractions(vertices["packed_position"], POSITION_BITS), ("x", "y", "z"))
    log_scale = between(_fractions(vertices["packed_scale"], POSITION_BITS), ("scale_x", "scale_y", "scale_z"))
    colour = _fractions(vertices["packed_color"], COLOUR_BITS)
    rgb = between(colour[:, :3], ("r", "g", "b")) if "min_r" in chunks else colour[:, :3]
    opacity = np.clip(colour[:, 3], 1e-6, 1 - 1e-6)
    columns = dict(zip(("x", "y", "z"), mean.T, strict=True))
    columns |= {f"scale_{i}": log_scale[:, i] for i in range(3)}
    columns |= {f"rot_{i}": x for i, x in enumerate(_quaternions(vertices["packed_rotation"]).T)}
    columns |= {f"f_dc_{i}": (rgb[:, i] - 0.5) / SH_C0 for i in range(3)}
    columns["opacity"] = np.log(opacity / (1 - opacity))
    return columns | {name: _coefficient(values) for name, values in higher.items()}


def _fractions(packed: np.ndarray, bits: tuple[int, ...]) -> np.ndarray:
    """Unsigned fields of 32-bit words, most significant first, as fractions 0..1."""
    shifts = 32 - np.cumsum(bits)
    fields = [(packed >> shift) & (2**width - 1) for shift, width in zip(shifts.tolist(), bits, strict=True)]
    return np.stack([field / (2**width - 1) for field, width in zip(fields, bits, strict=True)], axis=-1)


def _quaternions(packed: np.ndarray) -> np.ndarray:
    """Unit quaternions (w, x, y, z): two bits name the largest component, which the three others (±1/√2) determine."""
    rest = (_fractions(packed, ROTATION_BITS)[:, 1:] - 0.5) * np.sqrt(2)
    largest = np.sqrt(np.maximum(0, 1 - np.sum(rest * rest, axis=1)))
    place = (packed >> 30).astype(np.int64)
    quaternion = np.zeros((len(packed), 4))
    for index in range(4):
        rows = place == index
        quaternion[rows] = np.insert(rest[rows], index, largest[rows], axis=1)
    return quaternion


def _coefficient(values: np.ndarray) -> np.ndarray:
    """Bytes to coefficients: the middle of each of 256 steps over [-4, 4], the ends exact."""
    fraction = np.where(values == 0, 0.0, np.where(values == 255, 1.0, (values + 0.5) / 256))
    return (fraction - 0.5) * 8
