"""Wing beats of birds: joint angles over one cycle of flapping and gliding.

Stroke: the wing falls from top to bottom during `downstroke` of the beat and rises during the rest; the hand lags the
arm, folds at the wrist on the upstroke, and the body heaves against the wings (Tobalske 2007, J. Exp. Biol. 210, 3135).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.skeletons import Motion, Skeleton

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


@dataclass(frozen=True)
class WingBeat:
    """How a bird beats its wings; angles in degrees, heave in metres.

    rise, fall: stroke above and below level. downstroke: its share of the beat. fold: of the wrist at mid upstroke.
    lag: of the hand, in beats. beats: in a cycle, followed by `glide_seconds` with the wings held at `glide_angle`, or
    tucked to the body if `bounding`.
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


def stroke(beat: WingBeat, phase: Float[np.ndarray, "time"]) -> Float[np.ndarray, "time"]:
    """Arm elevation in degrees at phases in beats; 0 is the top of the stroke."""
    p = phase % 1.0
    down = np.cos(np.pi * p / beat.downstroke)
    up = -np.cos(np.pi * (p - beat.downstroke) / (1 - beat.downstroke))
    swing = np.where(p < beat.downstroke, down, up)
    return (beat.rise - beat.fall) / 2 + (beat.rise + beat.fall) / 2 * swing


def fly(beat: WingBeat, skeleton: Skeleton) -> Motion:
    """Sample one cycle; with a glide the beats swell in and die away within half a beat."""
    flap = beat.beats / beat.hertz
    seconds = np.linspace(0.0, flap, SAMPLES_PER_BEAT * beat.beats + 1)
    if beat.glide_seconds > 0:
        seconds = np.concatenate([seconds, np.linspace(flap, flap + beat.glide_seconds, 9)[1:]])
    phase = np.minimum(seconds, flap) * beat.hertz
    vigour = np.ones(len(seconds))
    if beat.glide_seconds > 0:
        vigour = _ease(np.minimum(phase, beat.beats - phase) / 0.5)
    level = (1 - vigour) * (0.0 if beat.bounding else beat.glide_angle)
    tuck = (1 - vigour) * (1.0 if beat.bounding else 0.0)
    arm = vigour * stroke(beat, phase) + level
    hand = vigour * 0.4 * (stroke(beat, phase - beat.lag) - stroke(beat, phase)) - 0.15 * arm
    rising = np.sin(np.pi * np.clip((phase % 1.0 - beat.downstroke) / (1 - beat.downstroke), 0, 1)) ** 2
    fold = vigour * beat.fold * rising
    pitch = vigour * 9.0 * np.sin(2 * np.pi * phase)
    quaternion = np.zeros((len(seconds), len(JOINTS), 4))
    quaternion[..., 0] = 1.0
    quaternion[:, 0] = _about("y", 0.3 * pitch)
    quaternion[:, 1] = _about("y", -0.3 * pitch)
    quaternion[:, 2] = _about("y", 0.6 * pitch)
    for side, joint in ((1.0, 3), (-1.0, 5)):
        sweep = side * (62.0 * tuck - 0.35 * fold)
        quaternion[:, joint] = _times(_about("x", side * arm), _times(_about("z", sweep), _about("y", pitch)))
        quaternion[:, joint + 1] = _times(_about("x", side * hand), _about("z", side * (fold + 22.0 * tuck)))
    shift = np.zeros((len(seconds), len(JOINTS), 3))
    shift[:, 0, 2] = -beat.heave * vigour * stroke(beat, phase) / (beat.rise + beat.fall)
    return Motion(seconds, quaternion, shift)


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
