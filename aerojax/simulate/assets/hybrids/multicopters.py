"""Multicopters of mixed families: any number of arms, frames, hulls, legs, guards and payloads exchanged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerojax.simulate.assets.families import draw
from aerojax.simulate.assets.hybrids.mixture import Rules, mixed_ranges
from aerojax.simulate.assets.multicopters.families import multicopter_families
from aerojax.simulate.assets.multicopters.layout import MulticopterParameters

RULES = Rules(
    groups={
        "layout": ("arms", "nose_angle", "tail_angle", "layout", "coaxial", "pusher", "propeller_fill", "arm_rise",
                   "rear_rise"),
        "frame": ("frame", "arm_width", "arm_height", "round_arms"),
        "hull": ("hull", "hull_length", "hull_width", "hull_height", "battery", "antennas", "gps_mast", "roof",
                 "roof_size"),
        "legs": ("legs", "leg_height"),
        "propellers": ("blades", "blade_chord", "motor_radius", "motor_height", "hertz"),
        "guard": ("guard", "guard_height"),
        "load": ("gimbal", "payload", "payload_size", "boom_span"),
    },
    whole={"air_taxi": ("layout", "hull"), "caged_quad": ("guard", "layout")},
    limits={"propeller_fill": (0.5, 0.97), "tail_angle": (30.0, 60.0), "blade_chord": (0.08, 0.3)},
)  # fmt: skip
OTHER_ARMS, ARMS = 0.35, (3, 8)
"""How often the number of arms is drawn anew, and from what range: the training families' fewest to most."""
BULKY, BULK = 0.25, (1.15, 1.7)
"""How often hull and arms are thicker than the families', and by how much: toys and armoured machines."""


def draw_hybrid_multicopter(rng: np.random.Generator) -> MulticopterParameters:
    """Draw a multicopter whose groups of parameters come from one to three training families."""
    p = draw(MulticopterParameters, mixed_ranges(multicopter_families(), RULES, rng), rng)
    if p.layout == "ring" and rng.random() < OTHER_ARMS:
        p = replace(p, arms=int(rng.integers(ARMS[0], ARMS[1] + 1)))
    p = _fitting(p, rng)
    if rng.random() < BULKY:
        bulk = float(rng.uniform(*BULK))
        p = replace(
            p,
            hull_width=min(bulk * p.hull_width, 0.5),
            hull_height=min(bulk * p.hull_height, 0.4),
            arm_width=bulk * p.arm_width,
            arm_height=bulk * p.arm_height,
            motor_radius=min(bulk * p.motor_radius, 0.07),
        )
    return p


def _fitting(p: MulticopterParameters, rng: np.random.Generator) -> MulticopterParameters:
    """Exchange what does not go together with these arms and guards."""
    if p.arms == 3 and p.coaxial:  # a Y6 is a test family
        p = replace(p, coaxial=False)
    if p.arms == 3:
        p = replace(p, nose_angle=float(rng.uniform(50.0, 66.0)))
    elif p.arms == 4 and p.layout == "ring" and not 30.0 <= p.nose_angle <= 65.0:
        p = replace(p, nose_angle=float(rng.uniform(36.0, 56.0)))
    elif p.arms > 4:  # even rings stand with an arm or a gap ahead; odd ones with an arm ahead or behind
        p = replace(p, nose_angle=float(rng.choice([0.0, 180.0 / p.arms])))
    if p.arms != 4:
        p = replace(p, layout="ring", frame="radial", rear_rise=0.0)
    elif p.layout == "plus":
        p = replace(p, frame="radial")
    if p.guard in ("ring", "duct"):  # neighbouring rings must not cut each other
        p = replace(p, propeller_fill=min(p.propeller_fill, 0.87))
    elif p.guard == "cage":
        p = replace(p, propeller_fill=min(p.propeller_fill, 0.72), arm_rise=0.0, boom_span=0.0)
        p = replace(p, legs="none", payload="none", roof="none", gps_mast=0.0)
    return p
