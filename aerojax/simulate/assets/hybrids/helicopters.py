"""Helicopters of mixed families: cabins, booms, tails, rotors and gear exchanged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerojax.simulate.assets.families import draw
from aerojax.simulate.assets.helicopters.families import helicopter_families
from aerojax.simulate.assets.helicopters.layout import HelicopterParameters
from aerojax.simulate.assets.hybrids.mixture import Rules, mixed_ranges

RULES = Rules(
    groups={
        "cabin": ("layout", "cabin_length", "cabin_width", "cabin_height", "cabin_exponent", "nose_height",
                  "nose_fullness", "belly_rise", "bubble"),
        "boom": ("boom", "boom_root", "boom_tip", "boom_height", "struts"),
        "mast": ("cowling_length", "cowling_height", "mast_place", "mast_height"),
        "tail": ("fin_height", "fin_chord", "fin_sweep", "fin_below", "stabiliser_span", "stabiliser_chord",
                 "stabiliser_place", "stabiliser_height", "end_plates", "tail_rotor", "tail_radius", "tail_blades",
                 "tail_gearing"),
        "rotor": ("blades", "rotor_ratio", "blade_chord", "coning", "hertz", "flybar"),
        "gear": ("gear", "gear_height", "gear_width"),
        "load": ("stub_wings", "sponsons", "cargo"),
    },
    whole={
        "tandem": ("cabin", "boom", "mast", "tail"),
        "sky_crane": ("cabin", "boom", "mast", "gear", "load", "tail"),
    },
    limits={"cabin_exponent": (1.8, 5.0), "nose_fullness": (0.35, 0.9), "cabin_length": (0.22, 0.97),
            "stabiliser_place": (0.65, 0.97), "coning": (0.0, 6.0), "rotor_ratio": (0.75, 1.35),
            "end_plates": (0.0, 0.13)},
)  # fmt: skip
BULKY, BULK = 0.25, (1.15, 1.7)
"""How often cabin and boom are thicker than the families', and by how much: toys and freighters."""
PLAIN_TAIL = 0.12
"""How often a helicopter has no tailplane, and as often no lower fin."""
OTHER_BLADES, BLADES = 0.35, (2, 7)
"""How often the number of main rotor blades is drawn anew, and from what range."""


def draw_hybrid_helicopter(rng: np.random.Generator) -> HelicopterParameters:
    """Draw a helicopter whose groups of parameters come from one to three training families."""
    p = draw(HelicopterParameters, mixed_ranges(helicopter_families(), RULES, rng), rng)
    if rng.random() < OTHER_BLADES:
        p = replace(p, blades=int(rng.integers(BLADES[0], BLADES[1] + 1)))
    if rng.random() < BULKY:
        bulk = float(rng.uniform(*BULK))
        p = replace(
            p,
            cabin_width=bulk * p.cabin_width,
            cabin_height=bulk * p.cabin_height,
            boom_root=bulk * p.boom_root,
            boom_tip=bulk * p.boom_tip,
            gear_width=max(p.gear_width, 0.9 * bulk * p.cabin_width),
        )
    if rng.random() < PLAIN_TAIL:
        p = replace(p, stabiliser_span=0.0, stabiliser_height=0.0)
    if rng.random() < PLAIN_TAIL:
        p = replace(p, fin_below=0.0)
    return _fitting(p)


def _fitting(p: HelicopterParameters) -> HelicopterParameters:
    """Bring parts of different parents together."""
    if p.layout == "tandem":
        p = replace(p, stub_wings=0.0, gear="wheels" if p.gear in ("stilts", "tucked") else p.gear)
        return replace(p, blades=min(p.blades, 4))
    if p.boom != "spine":  # only a spine has room for a container below it
        p = replace(p, cargo=0.0)
    p = replace(p, mast_place=min(p.mast_place, 0.85 * p.cabin_length) if p.boom != "spine" else p.mast_place)
    return replace(p, boom_tip=min(p.boom_tip, 0.8 * p.boom_root), gear_width=max(p.gear_width, 1.05 * p.cabin_width))
