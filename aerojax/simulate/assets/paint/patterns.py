"""Albedo patterns: solid functions of the rest-pose position and normal, layered over a palette.

A pattern is drawn from a seed alone and never sees the class, so a bird may have hazard stripes and a drone wing bars.
Solid functions need no unwrapping and run across the seams between parts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from aerojax.core.seeds import seed_of
from aerojax.simulate.assets.paint.palette import Palette, draw_palette

ROLES = 8
MAIN_SHARE, PATTERNED_SHARE = 0.6, 0.7
"""How often a part other than the skin has the skin's ground colour and its layers: often, because birds are
nearly all skin and what people build is not, so that parts in colours of their own would tell them apart."""
SOFTNESS = 0.008
"""Half width of an edge between two colours, in units of the asset's half size: about one texel."""


@dataclass(frozen=True)
class Surface:
    """Points of an asset that want a colour.

    position: rest pose, body frame, metres; of a spinning part in its own frame.
    normal: unit, same frame.
    along: x from -1 (tail) to 1 (nose).
    across: |y| over the half width, or the radius of a spinning part over its largest; 0..1.
    """

    position: Float[np.ndarray, "sample 3"]
    normal: Float[np.ndarray, "sample 3"]
    along: Float[np.ndarray, "sample"]
    across: Float[np.ndarray, "sample"]


@dataclass(frozen=True)
class Layer:
    """One layer of paint: where it lies (`kind` is a key of `MASKS`) and which palette colour it has.

    place, width, frequency: meaning by kind, in units of the half size and of cycles a metre. strength: 0..1.
    """

    kind: str
    slot: int
    place: float
    width: float
    frequency: float
    seed: int
    strength: float


@dataclass(frozen=True)
class Paint:
    """Everything that colours an asset.

    slot_of: the ground colour of each part's role.
    patterned: whether the layers cover a role.
    grain: relative amplitude of fine brightness noise.
    """

    palette: Palette
    layers: tuple[Layer, ...]
    slot_of: Int[np.ndarray, "role"]
    patterned: Bool[np.ndarray, "role"]
    grain: float
    seed: int


def _over(x: Float[np.ndarray, "sample"], edge: float, softness: float = SOFTNESS) -> Float[np.ndarray, "sample"]:
    """A smooth step from 0 below `edge` to 1 above."""
    t = np.clip((x - edge) / (2 * softness) + 0.5, 0.0, 1.0)
    return t * t * (3 - 2 * t)


def _band(x: Float[np.ndarray, "sample"], start: float, end: float) -> Float[np.ndarray, "sample"]:
    return _over(x, start) * (1 - _over(x, end))


def _waves(phase: Float[np.ndarray, "sample"], share: float) -> Float[np.ndarray, "sample"]:
    """1 on `share` of every unit of phase."""
    return _over(0.5 - np.abs(phase - np.floor(phase) - 0.5), 0.5 * (1 - share), 0.03)


def value_noise(points: Float[np.ndarray, "sample 3"], seed: int) -> Float[np.ndarray, "sample"]:
    """Smooth noise in 0..1 with features of size 1: hashed lattice values under a trilinear smoothstep."""
    floor = np.floor(points)
    t = points - floor
    t = t * t * (3 - 2 * t)
    cell = floor.astype(np.int64).astype(np.uint32)  # negative cells wrap, which a hash does not mind
    total = np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(np.array(corner) == 1, t, 1 - t), axis=1)
        total += weight * _hash(cell + np.array(corner, np.uint32), seed)
    return total


def _hash(cell: np.ndarray, seed: int) -> Float[np.ndarray, "sample"]:
    """Lattice points to 0..1 by the multiply-and-shift finaliser of 32-bit hashes."""
    h = cell[:, 0] * np.uint32(0x8DA6B343) ^ cell[:, 1] * np.uint32(0xD8163841) ^ cell[:, 2] * np.uint32(0xCB1AB31F)
    h = h ^ np.uint32(seed & 0xFFFFFFFF)
    for factor in (0x7FEB352D, 0x846CA68B):
        h = (h ^ (h >> np.uint32(16))) * np.uint32(factor)
    return (h ^ (h >> np.uint32(15))).astype(np.float64) / 2**32


def _belly(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    return _over(-s.normal[:, 2], layer.place - 0.3, 0.15)


def _tips(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    return _over(s.across, 0.55 + 0.35 * layer.place)


def _bars(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    return _band(s.across, 0.2 + 0.5 * layer.place, 0.24 + 0.5 * layer.place + 0.15 * layer.width)


def _hood(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    return _over(s.along, 0.25 + 0.5 * layer.place) * (1 - _over(s.across, 0.3))


def _rump(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    return _over(-s.along, 0.2 + 0.6 * layer.place) * (1 - _over(s.across, 0.45))


def _stripes(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    return _waves(s.position[:, 0] * layer.frequency + layer.place, 0.25 + 0.4 * layer.width)


def _cheatline(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    height = s.position[:, 2]
    return _band(height, 0.06 * (layer.place - 0.5), 0.06 * (layer.place - 0.5) + 0.012 + 0.04 * layer.width)


def _mottle(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    return _over(value_noise(s.position * layer.frequency, layer.seed), 0.45 + 0.2 * layer.place, 0.06)


def _speckle(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    return _over(value_noise(s.position * 5 * layer.frequency, layer.seed), 0.6 + 0.15 * layer.place, 0.06)


def _checks(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    waves = [_waves(s.position[:, i] * layer.frequency / 2 + layer.place, 0.5) for i in (0, 1)]
    return np.abs(waves[0] - waves[1])


def _panels(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    lines = [_waves(s.position[:, i] * layer.frequency + layer.place, 0.05) for i in (0, 1)]
    return np.maximum(*lines)


def _barring(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    wobble = value_noise(s.position * 9.0, layer.seed)
    return _waves(s.position[:, 0] * 3 * layer.frequency + wobble, 0.3 + 0.3 * layer.width)


def _hazard(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    diagonal = _waves((s.position[:, 0] + np.abs(s.position[:, 1])) * 1.5 * layer.frequency, 0.5)
    return diagonal * _band(s.across, 0.1 + 0.4 * layer.place, 0.35 + 0.4 * layer.place + 0.25 * layer.width)


def _roundel(layer: Layer, s: Surface) -> Float[np.ndarray, "sample"]:
    radius = 0.05 + 0.08 * layer.width
    offset = np.hypot(s.position[:, 0], 0.5 * (s.across - 0.25 - 0.4 * layer.place))
    rings = _band(offset / radius, 0.66, 1.0) + (1 - _over(offset / radius, 0.33))
    return rings * _over(np.abs(s.normal[:, 2]), 0.5, 0.1)


MASKS: dict[str, Callable[[Layer, Surface], Float[np.ndarray, "sample"]]] = {
    "belly": _belly,
    "tips": _tips,
    "bars": _bars,
    "hood": _hood,
    "rump": _rump,
    "stripes": _stripes,
    "cheatline": _cheatline,
    "mottle": _mottle,
    "speckle": _speckle,
    "checks": _checks,
    "panels": _panels,
    "barring": _barring,
    "hazard": _hazard,
    "roundel": _roundel,
}
"""Kind of layer, its coverage of a surface (0..1)."""


def draw_paint(seed: int) -> Paint:
    """Palette, layers and the roles that they cover, for any class."""
    rng = np.random.default_rng(seed_of("paint", seed))
    palette = draw_palette(seed)
    kinds = rng.choice(sorted(MASKS), size=int(rng.integers(2, 5)), replace=False)
    slots = len(palette.srgb)
    layers = tuple(
        Layer(
            kind=str(kind),
            slot=int(rng.integers(1, slots)),
            place=float(rng.uniform()),
            width=float(rng.uniform()),
            frequency=float(rng.uniform(4.0, 12.0)),
            seed=int(rng.integers(2**32)),
            strength=float(rng.uniform(0.7, 1.0)),
        )
        for kind in kinds
    )
    slot_of = np.where(rng.random(ROLES) < MAIN_SHARE, 0, rng.integers(0, slots, ROLES))
    slot_of[0] = 0
    patterned = rng.random(ROLES) < PATTERNED_SHARE
    patterned[0] = True
    return Paint(palette, layers, slot_of, patterned, float(rng.uniform(0.04, 0.16)), int(rng.integers(2**32)))


def colours(paint: Paint, role: int, surface: Surface, *, plain: bool = False) -> Float[np.ndarray, "sample 3"]:
    """sRGB albedo of a part's points; `role` 0 is the skin, 1..7 are other materials; `plain` parts have no layers."""
    srgb = np.repeat(paint.palette.srgb[paint.slot_of[role]][None], len(surface.position), axis=0)
    for layer in paint.layers if paint.patterned[role] and not plain else ():
        cover = (layer.strength * MASKS[layer.kind](layer, surface))[:, None]
        srgb = srgb + cover * (paint.palette.srgb[layer.slot] - srgb)
    grain = value_noise(surface.position * 45.0, paint.seed) + value_noise(surface.position * 110.0, paint.seed + 1) - 1
    return np.clip(srgb * (1 + paint.grain * grain[:, None]), 0.0, 1.0)
