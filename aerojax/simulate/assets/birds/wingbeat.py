"""Wing beats of birds: joint angles over one cycle of flapping and gliding.

Stroke: the wing falls from top to bottom during `downstroke` of the beat and rises during the rest; the hand lags the
arm, folds at the wrist on the upstroke, and the body heaves against the wings (Tobalske 2007, J. Exp. Biol. 210, 3135).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.simulate.usd.skeletons import Motion

JOINTS = (
    "body",
    "body/head",
    "body/tail",
    "body/arm_left",
    "body/arm_left/hand_left",
    "body/arm_right",
    "body/arm_right/hand_right",
)
SAMPLES_PER_BEAT = 24
"""Linear interpolation then errs by at most (2*pi/24)^2/8 = 0.9 % of the amplitude."""
SAMPLES_PER_GLIDE = 16
"""A glide rocks once: linear interpolation then errs by at most (2*pi/16)^2/8 = 1.9 % of the angle."""


@dataclass(frozen=True)
class WingBeat:
    """How a bird beats its wings; angles in degrees, heave in metres.

    rise, fall: stroke above and below level. downstroke: its share of the beat. fold: of the wrist at mid upstroke.
    lag: of the hand, in beats. beats: in a cycle, followed by `glide_seconds` with the wings held at `glide_angle`, or
    tucked to the body if `bounding`. stroke_plane: how far the stroke leans back from the vertical: the wings rise
    backwards and fall forwards, horizontally at 90 (hovering). glide_flex: of the wrist while gliding. rock: of the
    whole bird from side to side while gliding (soaring birds).
    """

    hertz: float
    rise: float
    fall: float
    downstroke: float
    fold: float
    lag: float
    heave: float
    beats: int
    glide_seconds: float
    glide_angle: float
    bounding: bool
    stroke_plane: float
    glide_flex: float
    rock: float


def wingbeat_hertz(mass: float, span: float, aspect: float) -> float:
    """Frequency at which a bird beats its wings in level flight, clipped to 2..14 Hz.

    f = m^(3/8) g^(1/2) b^(-23/24) S^(-1/3) rho^(-3/8) with S = b^2 / aspect (Pennycuick 1996, J. Exp. Biol. 199, 1613),
    in air of 1.225 kg/m^3. Above 15 Hz a camera of 30 frames a second cannot follow a wing.

    Args:
        mass: kilograms.
        span: metres.
        aspect: span squared over wing area.
    """
    area = span**2 / aspect
    hertz = mass ** (3 / 8) * 9.81**0.5 * span ** (-23 / 24) * area ** (-1 / 3) * 1.225 ** (-3 / 8)
    return min(max(hertz, 2.0), 14.0)


def stroke(beat: WingBeat, phase: Float[np.ndarray, "time"]) -> Float[np.ndarray, "time"]:
    """Arm elevation in degrees at phases in beats; 0 is the top of the stroke."""
    p = phase % 1.0
    down = np.cos(np.pi * p / beat.downstroke)
    up = -np.cos(np.pi * (p - beat.downstroke) / (1 - beat.downstroke))
    swing = np.where(p < beat.downstroke, down, up)
    return (beat.rise - beat.fall) / 2 + (beat.rise + beat.fall) / 2 * swing


def fly(beat: WingBeat, head_pitch: float = 0.0) -> Motion:
    """Sample one cycle of the joints of `JOINTS`; with a glide the beats swell in and die away within half a beat.

    Args:
        beat: the wing beat.
        head_pitch: degrees, nose down, of the head against the trunk throughout the cycle.
    """
    seconds, phase, vigour, gliding = _timeline(beat)
    still = 1 - vigour
    arm = vigour * stroke(beat, phase) + still * (0.0 if beat.bounding else beat.glide_angle)
    hand = vigour * 0.4 * (stroke(beat, phase - beat.lag) - stroke(beat, phase)) - 0.15 * arm
    rising = np.sin(np.pi * np.clip((phase % 1.0 - beat.downstroke) / (1 - beat.downstroke), 0, 1)) ** 2
    fold = vigour * beat.fold * rising + still * (0.0 if beat.bounding else beat.glide_flex)
    tuck = still * (1.0 if beat.bounding else 0.0)
    pitch = vigour * 9.0 * np.sin(2 * np.pi * phase)
    quaternion = np.zeros((len(seconds), len(JOINTS), 4))
    roll = beat.rock * np.sin(2 * np.pi * gliding)
    quaternion[:, 0] = _times(_about("x", roll), _about("y", 0.3 * pitch))
    quaternion[:, 1] = _about("y", head_pitch - 0.3 * pitch)
    quaternion[:, 2] = _about("y", 0.6 * pitch)
    lean = _about("y", np.full(len(seconds), -beat.stroke_plane))
    upright = _about("y", np.full(len(seconds), beat.stroke_plane))
    # A tucked wing lies over the back: swept along the body, its leading edge rolled down the flank.
    twist = _about("y", pitch + 22.0 * tuck)
    for side, joint in ((1.0, 3), (-1.0, 5)):
        swing = _times(lean, _times(_about("x", side * arm), upright))
        sweep = side * (80.0 * tuck - 0.35 * fold)
        quaternion[:, joint] = _times(swing, _times(_about("z", sweep), twist))
        quaternion[:, joint + 1] = _times(_about("x", side * hand), _about("z", side * fold))
    shift = np.zeros((len(seconds), len(JOINTS), 3))
    shift[:, 0, 2] = -beat.heave * vigour * stroke(beat, phase) / (beat.rise + beat.fall)
    return Motion(seconds, quaternion, shift)


def _timeline(beat: WingBeat) -> tuple[Float[np.ndarray, "time"], ...]:
    """Sample times, phase in beats, vigour (1 beating, 0 gliding) and the share of the glide that has passed."""
    flap = beat.beats / beat.hertz
    seconds = np.linspace(0.0, flap, SAMPLES_PER_BEAT * beat.beats + 1)
    if beat.glide_seconds == 0:
        return seconds, seconds * beat.hertz, np.ones(len(seconds)), np.zeros(len(seconds))
    seconds = np.concatenate([seconds, np.linspace(flap, flap + beat.glide_seconds, SAMPLES_PER_GLIDE + 1)[1:]])
    phase = np.minimum(seconds, flap) * beat.hertz
    vigour = _ease(np.minimum(phase, beat.beats - phase) / 0.5)
    return seconds, phase, vigour, np.maximum(seconds - flap, 0.0) / beat.glide_seconds


def _ease(share: Float[np.ndarray, "time"]) -> Float[np.ndarray, "time"]:
    t = np.clip(share, 0, 1)
    return t * t * (3 - 2 * t)


def _about(axis: str, degrees: Float[np.ndarray, "time"]) -> Float[np.ndarray, "time 4"]:
    half = np.deg2rad(degrees) / 2
    q = np.zeros((len(half), 4))
    q[:, 0], q[:, 1 + "xyz".index(axis)] = np.cos(half), np.sin(half)
    return q


def _times(a: Float[np.ndarray, "time 4"], b: Float[np.ndarray, "time 4"]) -> Float[np.ndarray, "time 4"]:
    """Hamilton product: the rotation `b` first, then `a`."""
    aw, bw, av, bv = a[:, :1], b[:, :1], a[:, 1:], b[:, 1:]
    real = aw * bw - (av * bv).sum(1, keepdims=True)
    return np.concatenate([real, aw * bv + bw * av + np.cross(av, bv)], axis=1)
