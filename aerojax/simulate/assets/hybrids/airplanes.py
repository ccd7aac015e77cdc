"""Airplanes of mixed families: fuselages, wings, tails, engines and gear exchanged, with the wing where it can fly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerojax.simulate.assets.airplanes.families import airplane_families
from aerojax.simulate.assets.airplanes.shape import AirplaneParameters, wing_root
from aerojax.simulate.assets.families import draw
from aerojax.simulate.assets.hybrids.mixture import Rules, mixed_ranges

_WING = ("wing", "tail", "fuselage")
RULES = Rules(
    groups={
        "fuselage": ("length", "width", "height", "exponent", "nose_power", "nose_fullness", "cabin_end", "tail_rise",
                     "balance"),
        "canopy": ("canopy",),
        "wing": ("wing_height", "root_chord", "taper", "straight_share", "sweep", "dihedral", "tip_dihedral",
                 "thickness", "winglet", "tip_round"),
        "tail": ("tail", "tail_span", "tail_chord", "fin_height", "fin_chord", "tail_sweep"),
        "power": ("power", "engines", "engine_size", "blades", "propeller_radius", "hertz"),
        "gear": ("gear",),
        "struts": ("struts",),
    },
    whole={"flying_wing": _WING},
    limits={"taper": (0.1, 1.0), "straight_share": (0.0, 0.65), "tip_round": (0.0, 1.0), "thickness": (0.035, 0.18),
            "nose_fullness": (0.4, 0.95), "cabin_end": (0.34, 0.76), "winglet": (0.0, 0.08), "wing_height": (-1.0, 1.0),
            "sweep": (0.0, 60.0), "nose_power": (1.0, 2.0)},
)  # fmt: skip
BULKY, BULK = 0.25, (1.15, 1.8)
"""How often fuselage and wings are thicker than the families', and by how much: toys, freighters, trainers."""
OTHER_BLADES, BLADES = 0.3, (2, 4)
"""How often the number of blades is drawn anew, and from what range: the training families' fewest to most."""


def draw_hybrid_airplane(rng: np.random.Generator) -> AirplaneParameters:
    """Draw an airplane whose groups of parameters come from one to three training families."""
    p = draw(AirplaneParameters, mixed_ranges(airplane_families(), RULES, rng), rng)
    if rng.random() < BULKY:
        bulk = float(rng.uniform(*BULK))
        p = replace(
            p,
            width=max(p.width, min(bulk * p.width, 0.23 * p.length, 0.2)),
            height=max(p.height, min(bulk * p.height, 0.23 * p.length, 0.2)),
            thickness=min(bulk * p.thickness, 0.2),
        )
    if rng.random() < OTHER_BLADES:
        p = replace(p, blades=int(rng.integers(BLADES[0], BLADES[1] + 1)))
    return _fitting(p)


def _fitting(p: AirplaneParameters) -> AirplaneParameters:
    """Bring chords, wing and gear of different parents together."""
    if p.tail != "none":
        chord = min(p.root_chord, 0.46 * p.length)
        p = replace(p, root_chord=chord, tail_span=min(p.tail_span, 0.65), fin_chord=min(p.fin_chord, 0.24 * p.length),
                    tail_chord=min(p.tail_chord, 0.2 * p.length))  # fmt: skip
    else:
        p = replace(p, canopy=0.0 if p.height < 0.07 else p.canopy)
    if p.power == "nose" and p.gear != "none" and p.propeller_radius > 0.11:
        p = replace(p, propeller_radius=0.11)
    if p.wing_height < 0.2:  # struts brace high wings
        p = replace(p, struts=False)
    return _balanced(p)


def _balanced(p: AirplaneParameters) -> AirplaneParameters:
    """Move the wing so that its root's chord lies along the fuselage, between the nose and the tailplane."""
    if p.tail == "none":
        return p
    lead = -wing_root(p)[0]
    earliest = 0.16 * p.length
    latest = max(0.94 * p.length - 0.6 * p.tail_chord - p.root_chord, earliest)
    return replace(p, balance=p.balance + (float(np.clip(lead, earliest, latest)) - lead) / p.length)
