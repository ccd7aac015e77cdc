"""Palettes of colours, from one generator that never sees the class, so that no classifier can learn it from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

SLOTS = 5
"""Colours a palette: main, second, trim, detail and one of the extremes."""

SCHEMES: dict[str, tuple[str, ...]] = {
    "browns": ("5b4230", "8a6a4a", "b89b76", "e6dbc4", "2e241d", "94512f"),
    "greys": ("f2f2ee", "c4c8ca", "8f979c", "5a636a", "2b2f33", "e0dccf"),
    "slate and buff": ("55636f", "7f8f9a", "d8c6a2", "f3ede0", "33302e", "a4552f"),
    "greens": ("4d5a35", "6f7f49", "a8a878", "d9d8c0", "2b3324", "8b7d3c"),
    "blacks": ("121314", "232628", "3a3e42", "595d60", "8e2f28", "d8d8d4"),
    "desert": ("c8ab7c", "a08258", "746249", "e4d6b4", "4b4438", "6b6f58"),
    "white livery": ("f4f5f6", "e3e6e8", "1f4f9c", "c22730", "20242a", "d9a021"),
    "bright livery": ("d4262c", "f4f4f2", "f0b51e", "1b3f87", "26292d", "2a8a4a"),
    "plastics": ("f26a1b", "f7d417", "17a2c4", "7ac143", "e83e77", "1c1c1e"),
    "sea": ("1c6f84", "8fc4cb", "f0f4f2", "14344a", "d07b3c", "5c8f8a"),
}
"""Plumages, liveries, camouflages and plastics; sRGB in hexadecimal."""


@dataclass(frozen=True)
class Palette:
    """Colours of one asset.

    srgb: the colours, 0..1; the first is the ground of the skin.
    roughness: of its surface, 0 mirror to 1 matte (UsdPreviewSurface).
    """

    srgb: Float[np.ndarray, "slot 3"]
    roughness: float


def draw_palette(seed: int) -> Palette:
    """Colours for any class: three in four palettes follow a scheme with some jitter, the others are free."""
    rng = np.random.default_rng(seed)
    if rng.random() < 0.75:
        scheme = list(SCHEMES.values())[int(rng.integers(len(SCHEMES)))]
        picked = [scheme[i] for i in rng.permutation(len(scheme))[:SLOTS]]
        srgb = np.array([[int(colour[i : i + 2], 16) / 255 for i in (0, 2, 4)] for colour in picked])
        srgb = srgb * rng.uniform(0.8, 1.15, (SLOTS, 1)) + rng.normal(0, 0.02, (SLOTS, 3))
    else:
        srgb = np.stack([_free_colour(rng) for _ in range(SLOTS)])
    return Palette(np.clip(srgb, 0.02, 0.97), float(rng.uniform(0.3, 0.9)))


def _free_colour(rng: np.random.Generator) -> Float[np.ndarray, "3"]:
    """Greys, earths and saturated paints in equal shares, dark to light."""
    kind, value = rng.integers(3), rng.uniform(0.06, 0.95)
    hue, saturation = rng.uniform(0, 1), (rng.uniform(0, 0.08), rng.uniform(0.2, 0.5), rng.uniform(0.5, 0.95))[kind]
    if kind == 1:
        hue = rng.uniform(0.04, 0.16)
    sector = (hue * 6 + np.array([5.0, 3.0, 1.0])) % 6
    return value - value * saturation * np.clip(np.minimum(sector, 4 - sector), 0, 1)
