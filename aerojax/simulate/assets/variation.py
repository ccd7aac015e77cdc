"""What varies between identities: draws from ranges of parameters, and colours.

Colours come from one generator that never sees the class, so that no classifier can learn the class from them.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float, Int

_T = TypeVar("_T")

SLOTS = 4
"""Colours a palette: main, second, trim and detail."""


def seed_of(*words: object) -> int:
    """A 63-bit seed from any printable words; the same in every process and on every machine."""
    digest = hashlib.blake2b("/".join(map(str, words)).encode(), digest_size=8).digest()
    return int.from_bytes(digest, "big") >> 1


def draw(kind: type[_T], ranges: Mapping[str, Any], rng: np.random.Generator) -> _T:
    """Fill a dataclass of parameters from ranges.

    A tuple of two numbers is a uniform range (integers inclusive), a list is a choice of equals, anything else is a
    fixed value. Fields are drawn in the order of the class, so that a seed means the same whatever the order of
    `ranges`.

    Raises:
        TypeError: if `ranges` names a field that `kind` lacks or misses one without default.
    """
    values = {}
    for field in dataclasses.fields(kind):  # pyrefly: ignore
        if field.name in ranges:
            values[field.name] = _draw_one(ranges[field.name], rng)
    unknown = set(ranges) - set(values)
    if unknown:
        raise TypeError(f"{kind.__name__} has no parameter {sorted(unknown)}")
    return kind(**values)


def _draw_one(spec: Any, rng: np.random.Generator) -> Any:
    if isinstance(spec, list):
        return spec[int(rng.integers(len(spec)))]
    if isinstance(spec, tuple) and all(isinstance(v, int) for v in spec):
        return int(rng.integers(spec[0], spec[1] + 1))
    if isinstance(spec, tuple):
        return float(rng.uniform(*spec))
    return spec


@dataclasses.dataclass(frozen=True)
class Palette:
    """Colours of one asset and where they go.

    srgb: the colours, 0..1.
    slot_of: which colour a part's role number takes (roles are 0..7).
    belly: whether faces that look down take the second colour of skins (counter-shading).
    tips: fraction of the half width beyond which skins take the trim colour; 1 or more means none.
    """

    srgb: Float[np.ndarray, "slot 3"]
    slot_of: Int[np.ndarray, "role"]
    belly: bool
    tips: float


def draw_palette(seed: int) -> Palette:
    """Colours for any class: greys, earths and saturated paints in equal shares, dark to light."""
    rng = np.random.default_rng(seed)
    srgb = np.stack([_draw_colour(rng) for _ in range(SLOTS)])
    slot_of = np.concatenate([[0], rng.integers(0, SLOTS, 7)])
    tips = float(rng.uniform(0.55, 0.9)) if rng.random() < 0.35 else 1.0
    return Palette(srgb, slot_of, bool(rng.random() < 0.4), tips)


def _draw_colour(rng: np.random.Generator) -> Float[np.ndarray, "3"]:
    kind, value = rng.integers(3), rng.uniform(0.06, 0.95)
    hue, saturation = rng.uniform(0, 1), (rng.uniform(0, 0.08), rng.uniform(0.2, 0.5), rng.uniform(0.5, 0.95))[kind]
    if kind == 1:
        hue = rng.uniform(0.04, 0.16)
    sector = (hue * 6 + np.array([5.0, 3.0, 1.0])) % 6
    return value - value * saturation * np.clip(np.minimum(sector, 4 - sector), 0, 1)


def face_colours(
    palette: Palette, role: int, normals: Float[np.ndarray, "face 3"], width: Float[np.ndarray, "face"]
) -> Float[np.ndarray, "face 3"]:
    """sRGB colour a face; role 0 is the skin, which takes the palette's pattern.

    Args:
        palette: the asset's colours.
        role: 0 skin, 1..7 other materials.
        normals: unit, body frame.
        width: |y| of the faces' centres over the asset's half width.
    """
    slots = np.full(len(normals), int(palette.slot_of[role]))
    if role == 0 and palette.belly:
        slots[normals[:, 2] < -0.2] = 1
    if role == 0:
        slots[width > palette.tips] = 2
    return palette.srgb[slots]
