"""Parameters of an airplane's shape and where its wing is; lengths are fractions of the wing span."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class AirplaneParameters:
    """Shape of an airplane; lengths over the wing span, angles in degrees.

    wing_height: of the wing's root over the fuselage's half height; ±1 is roof or belly.
    balance: share of the length, from the nose, at which the wing's mean quarter chord lies.
    straight_share: share of the half span with constant chord. tip_round: 0 square to 1 rounded.
    pod: share of the length that the fuselage takes between twin booms or under a keel.
    pod_pair: whether jet pods hang in pairs. floats: length of the floats. keel: whether the tail sits on a tube at
    the wing's height, with the fuselage a pod under it, wires and a king post (ultralights).
    """

    length: float
    width: float
    height: float
    exponent: float
    nose_power: float
    nose_fullness: float
    cabin_end: float
    tail_rise: float
    canopy: float
    wing_height: float
    balance: float
    root_chord: float
    taper: float
    straight_share: float
    sweep: float
    dihedral: float
    tip_dihedral: float
    thickness: float
    winglet: float
    tip_round: float
    tail: Literal["conventional", "t", "v", "twin", "h", "boom", "cruciform", "none"]
    tail_span: float
    tail_chord: float
    fin_height: float
    fin_chord: float
    tail_sweep: float
    power: Literal["nose", "pusher", "overhead", "wing_propellers", "pods", "rear_pods", "jet", "jetless"]
    engines: int
    engine_size: float
    blades: int
    propeller_radius: float
    hertz: float
    gear: Literal["none", "nose_wheel", "tail_wheel"]
    struts: bool = False
    biplane_gap: float = 0.0
    stagger: float = 0.0
    canard: float = 0.0
    booms: float = 0.0
    pod: float = 0.62
    pod_pair: bool = False
    floats: float = 0.0
    keel: bool = False

    @property
    def fuselage_length(self) -> float:
        """The fuselage ends early between booms and under a keel."""
        return self.length * (self.pod if self.booms > 0 or self.keel else 1.0)

    @property
    def tail_height(self) -> float:
        """z of the tailplane's root."""
        return 0.5 * self.tail_rise * self.height


def wing_root(p: AirplaneParameters) -> tuple[float, float]:
    """x and z of the leading edge at the plane of symmetry."""
    mean = p.root_chord * (1 + p.taper * (1 - p.straight_share) + p.straight_share) / 2
    y_mean = 0.22 if p.taper < 0.8 else 0.25
    x = -p.balance * p.length + 0.25 * mean + y_mean * float(np.tan(np.deg2rad(p.sweep)))
    return x, 0.5 * p.wing_height * p.height


def wing_at(
    p: AirplaneParameters, share: Float[np.ndarray, "n"]
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]]:
    """Leading edge and chord of the left wing at shares of the half span."""
    x, z = wing_root(p)
    y = 0.5 * share
    fall = np.clip((share - p.straight_share) / (1 - p.straight_share + 1e-9), 0, 1)
    chord = p.root_chord * (1 - (1 - p.taper) * fall)
    outer = np.clip(y - 0.33, 0, None)
    rise = np.tan(np.deg2rad(p.dihedral)) * y + np.tan(np.deg2rad(p.tip_dihedral)) * outer
    back = np.tan(np.deg2rad(p.sweep)) * y
    if p.straight_share > 0:
        back = back + 0.4 * (p.root_chord - chord)
    return np.stack([x - back, y, z + rise], axis=1), chord
