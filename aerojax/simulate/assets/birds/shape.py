"""Parameters of a bird's shape; lengths are fractions of the wing span.

Proportions follow field guides: length over span 0.35 (albatross), 0.42 (gull), 0.5 (pigeon, crow), 0.62 (passerine);
aspect ratio (span squared over wing area) 4 to 15; the hand is 0.4-0.6 of the half span, more in swifts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class BirdShape:
    """Shape of a bird; lengths over the wing span, angles in degrees.

    neck_rise: of the head above the body. head_radius: half the depth of the skull. crest: length of the feathers over
    the crown (0 is none). bill: a key of `bird_bodies.BILLS`. tail: a key of `bird_bodies.TAILS`; tail_width is that of
    the spread end. leg_drop: of the legs below the tail. body_pitch: of the trunk against the wings, nose up (slow
    flight); the head stays level. hand: share of the half span beyond the wrist. wrist_forward: of the wrist before the
    shoulder. tip_sweep: of the tip behind the wrist. tip: "pointed", "round" or "slotted". fingers: separated primaries
    of a slotted tip. arch: of the wing in front view. wing_place: share of the body length, from its front, of the
    wing's quarter chord. neck_fold: how far an S-bent neck hangs below its ends, over its radius. mass, span: of the
    living bird, kilograms and metres; they set the wing beat's frequency, not the size.
    """

    body_length: float
    body_width: float
    body_depth: float
    neck_length: float
    neck_radius: float
    neck_rise: float
    head_radius: float
    bill_length: float
    bill_radius: float
    tail: Literal["fan", "square", "wedge", "pointed", "lance", "notch", "fork", "streamers"]
    tail_length: float
    tail_width: float
    legs: float
    leg_drop: float
    body_pitch: float
    aspect: float
    hand: float
    wrist_forward: float
    tip_sweep: float
    tip: Literal["pointed", "round", "slotted"]
    fingers: int
    arch: float
    wing_place: float
    bill: Literal["cone", "dagger", "hook", "curved", "flat", "pouch", "bent"]
    crest: float
    neck_fold: float
    mass: float
    span: float

    @property
    def front(self) -> float:
        """x of the breast; the origin lies under the wing's mean quarter chord."""
        return self.wing_place * self.body_length

    @property
    def rump(self) -> float:
        """x where the tail is rooted."""
        return self.front - 0.88 * self.body_length

    @property
    def shoulder(self) -> float:
        """Where the arm leaves the body, as a share of the half span."""
        return 0.7 * self.body_width

    @property
    def slotted(self) -> bool:
        """Whether the primaries stand apart like fingers."""
        return self.tip == "slotted" and self.fingers > 0
