"""Parameters of a helicopter and where its cabin, boom and rotors are.

Lengths are fractions of the fuselage length, nose to tail; the nose is at x = 0. Proportions follow real machines:
rotor diameter over fuselage length 1.11 (R44), 1.15 (Bo 105), 1.06 (UH-60), 0.97 (AH-64), 1.0 (EC135); cabin width
0.13-0.2; blade chord 0.05-0.08 of the radius.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from aerojax.simulate.assets.mesh.lofts import Key
from aerojax.simulate.assets.mesh.shapes import Vector


@dataclass(frozen=True)
class HelicopterParameters:
    """Shape of a helicopter; lengths over the fuselage length, angles in degrees.

    layout: "single", "tandem", "coaxial" or "intermeshing" (two masts side by side that lean apart).
    boom: "tube", "rod", "truss" or "spine" (a beam from the cabin's roof to the tail, nothing below it).
    tail_rotor: "open", "fenestron", "jet" (a slotted can that blows sideways) or "none".
    gear: "skids", "wheels", "tucked" or "stilts" (long wheeled legs from the spine).
    stabiliser_height: where the tailplane sits on the fin, 0 on the boom to 1 at the fin's tip.
    cargo: length of a container under the spine; flybar: span of paddles above the head over the rotor's radius.
    bubble: whether the cabin's whole front is glass; struts: whether two rods brace the boom.
    """

    layout: Literal["single", "tandem", "coaxial", "intermeshing"]
    cabin_length: float
    cabin_width: float
    cabin_height: float
    cabin_exponent: float
    nose_height: float
    nose_fullness: float
    belly_rise: float
    boom_root: float
    boom_tip: float
    boom_height: float
    boom: Literal["tube", "rod", "truss", "spine"]
    cowling_length: float
    cowling_height: float
    fin_height: float
    fin_chord: float
    fin_sweep: float
    fin_below: float
    stabiliser_span: float
    stabiliser_chord: float
    stabiliser_place: float
    end_plates: float
    tail_rotor: Literal["open", "fenestron", "jet", "none"]
    tail_radius: float
    tail_blades: int
    blades: int
    rotor_ratio: float
    blade_chord: float
    mast_place: float
    mast_height: float
    coning: float
    gear: Literal["skids", "wheels", "tucked", "stilts"]
    gear_height: float
    gear_width: float
    hertz: float
    tail_gearing: float
    stub_wings: float = 0.0
    sponsons: float = 0.0
    stabiliser_height: float = 0.0
    cargo: float = 0.0
    flybar: float = 0.0
    bubble: bool = False
    struts: bool = False


def cabin_keys(p: HelicopterParameters) -> list[Key]:
    """Cabin from the nose at x = 0 aft; its rear closes at the height of the boom."""
    w, h, length = p.cabin_width / 2, p.cabin_height / 2, p.cabin_length
    low = p.nose_height * h
    rear = p.belly_rise * h + 0.35 * p.boom_height
    return [
        (0.0, 0.06 * w, 0.05 * h, low),
        (-0.12 * length, p.nose_fullness * w, p.nose_fullness * h, 0.55 * low),
        (-0.38 * length, w, h, 0.0),
        (-0.66 * length, 0.96 * w, 0.94 * h, 0.06 * h),
        (-0.88 * length, 0.6 * w, 0.55 * h, 0.6 * rear),
        (-length, 0.12 * w, 0.14 * h, rear),
    ]


def boom_height(p: HelicopterParameters, x: float) -> float:
    """Height of the boom's axis; it rises from the cabin's rear (a spine from the roof) to the tail."""
    if p.boom == "spine":
        return 0.34 * p.cabin_height - p.boom_height * x
    rise = 0.4 * p.boom_height
    start = 0.5 * p.belly_rise * p.cabin_height * 0.6 + 0.35 * p.boom_height
    return start + rise * (x + p.cabin_length) / (p.cabin_length - 1.0)


def tail_hub(p: HelicopterParameters) -> Vector:
    """Hub of the tail rotor."""
    x = -0.985 + 0.4 * p.fin_chord
    if p.tail_rotor == "fenestron":
        return (-0.985 + p.fin_chord - p.tail_radius - 0.01, 0.0, boom_height(p, -0.97) - 0.01)
    lift = max(0.75 * p.fin_height, p.tail_radius + 0.02) if p.fin_below == 0 else 0.1 * p.fin_height
    if p.stabiliser_height > 0:  # below the tailplane
        lift = p.stabiliser_height * p.fin_height - p.tail_radius - 0.025
    sweep = p.fin_sweep * lift if p.fin_below == 0 else 0.0
    return (x - 0.6 * sweep, 0.012 + max(0.025, p.boom_tip), boom_height(p, -0.97) + lift)


@dataclass(frozen=True)
class Hub:
    """A main rotor's hub, its axis (need not be unit) and whether it turns clockwise seen from above."""

    place: Vector
    axis: Vector
    clockwise: bool = False


FORWARD_LEAN = float(np.sin(np.deg2rad(3.0)))
"""Shafts lean 3 degrees forward, so that the cabin is level in cruise."""


def hubs(p: HelicopterParameters) -> list[Hub]:
    """Main rotors; the second of a pair turns against the first."""
    forward = (FORWARD_LEAN, 0.0, 1.0)
    base = 0.5 * p.cabin_height + 0.5 * p.cowling_height
    if p.layout == "tandem":
        top = 0.5 * p.cabin_height
        front = (-p.mast_place, 0.0, top + 0.3 * p.mast_height + 0.03)
        return [Hub(front, forward), Hub((-0.9, 0.0, p.fin_height + 0.07), forward, True)]
    x, z = -p.mast_place, base + p.mast_height
    if p.layout == "coaxial":
        return [Hub((x, 0.0, z), (0.0, 0.0, 1.0)), Hub((x, 0.0, z + 0.095), (0.0, 0.0, 1.0), True)]
    if p.layout == "intermeshing":
        # Masts 0.13 apart that lean 14 degrees outwards let each disc pass 0.03 above the other hub.
        lean = float(np.tan(np.deg2rad(14.0)))
        return [Hub((x, side * 0.065, z), (FORWARD_LEAN, side * lean, 1.0), side < 0) for side in (1.0, -1.0)]
    return [Hub((x, 0.0, z), forward)]
