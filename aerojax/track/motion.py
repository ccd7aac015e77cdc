"""How objects move between sights: constant acceleration, and an extended Kalman filter on pixels.

State: position, velocity, acceleration of the body, and by how far the middle of its outline is off the body (metres,
seconds, world): twelve numbers. Wings that beat and rotors that turn displace that middle for all cameras alike, and
otherwise in the next moment. All functions take many objects at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from aerojax.track.sights import NoiseConfig, Scan, TimedCamera, calibration_variance, sight_of_points

STATE = 12
"""Numbers of a state."""
States = Float64[np.ndarray, "track 12"]
Covariances = Float64[np.ndarray, "track 12 12"]
Sizes = Float64[np.ndarray, "track"]


@dataclass(frozen=True)
class MotionConfig:
    """What objects may do.

    jerk: spectral density of the white noise that drives the acceleration, as a root, m/s³ in a hertz's root.
    acceleration: standard deviation of each component where nothing is known of it yet, m/s².
    """

    jerk: float = 15.0
    acceleration: float = 5.0


def predict(
    states: States, covariances: Covariances, elapsed_s: float, config: MotionConfig, shaken_m: Sizes
) -> tuple[States, Covariances]:
    """Constant acceleration with white jerk (Bar-Shalom, Li & Kirubarajan 2001, §6.2.3); where the outline's middle is
    off the body is forgotten.

    Args:
        states, covariances: of the objects.
        elapsed_s: by how much time goes on; positive.
        config: see there.
        shaken_m: standard deviation of the outline's middle about the body, each axis, metres.
    """
    t = elapsed_s
    step = np.kron(np.array([[1, t, t**2 / 2, 0], [0, 1, t, 0], [0, 0, 1, 0], [0, 0, 0, 0]]), np.eye(3))
    noise = np.zeros((len(states), 4, 4))
    noise[:, :3, :3] = [[t**5 / 20, t**4 / 8, t**3 / 6], [t**4 / 8, t**3 / 3, t**2 / 2], [t**3 / 6, t**2 / 2, t]]
    noise[:, :3, :3] *= config.jerk**2
    noise[:, 3, 3] = shaken_m**2
    driven = np.kron(noise, np.eye(3))
    return states @ step.T, step @ covariances @ step.T + driven


@dataclass(frozen=True, eq=False)
class Expected:
    """Every sight of a scan against every object.

    off: observed minus expected pixel. by_state: derivative of the pixel. spread: covariance of `off`.
    distance: its squared Mahalanobis length, infinite where the object lies behind the camera.
    log_spread: logarithm of the determinant of `spread`.
    """

    off: Float64[np.ndarray, "track sight 2"]
    by_state: Float64[np.ndarray, "track sight 2 12"]
    spread: Float64[np.ndarray, "track sight 2 2"]
    distance: Float64[np.ndarray, "track sight"]
    log_spread: Float64[np.ndarray, "track sight"]


def expect(states: States, covariances: Covariances, scan: Scan, camera: TimedCamera, noise: NoiseConfig) -> Expected:
    """Compare objects, predicted to the scan's moment, with its sights, each at the moment of its own row."""
    lag = (scan.times - scan.time_s)[None, :, None]
    position, velocity, acceleration, aside = (states[:, None, i : i + 3] for i in (0, 3, 6, 9))
    pixels, by_point, depth = sight_of_points(position + lag * velocity + lag**2 / 2 * acceleration + aside, camera)
    lag = lag[..., None]
    by_state = np.concatenate([by_point, by_point * lag, by_point * lag**2 / 2, by_point], axis=-1)
    spread = by_state @ covariances[:, None] @ by_state.swapaxes(-1, -2)
    own = scan.variance[None, :] + calibration_variance(depth, camera, noise)
    spread = spread + own[..., None, None] * np.eye(2)
    off = scan.pixels[None] - pixels
    distance = np.einsum("tsi,tsi->ts", off, np.linalg.solve(spread, off[..., None])[..., 0])
    distance = np.where(depth > 0, distance, np.inf)
    return Expected(off, by_state, spread, distance, np.linalg.slogdet(spread)[1])


def update(
    states: States,
    covariances: Covariances,
    expected: Expected,
    tracks: Int64[np.ndarray, "pair"],
    sights: Int64[np.ndarray, "pair"],
) -> tuple[Float64[np.ndarray, "pair 12"], Float64[np.ndarray, "pair 12 12"]]:
    """Correct objects by one sight each: the extended Kalman filter in Joseph's form, which keeps covariances positive.

    Args:
        states, covariances: predicted.
        expected: of them.
        tracks, sights: which objects, and the sight of each in the scan.

    Returns:
        States and covariances of these objects.
    """
    H, S, off = (part[tracks, sights] for part in (expected.by_state, expected.spread, expected.off))
    before = covariances[tracks]
    across = before @ np.swapaxes(H, 1, 2)
    gain = np.swapaxes(np.linalg.solve(S, np.swapaxes(across, 1, 2)), 1, 2)
    kept = np.eye(STATE) - gain @ H
    own = S - H @ across
    corrected = kept @ before @ np.swapaxes(kept, 1, 2) + gain @ own @ np.swapaxes(gain, 1, 2)
    moved = states[tracks] + (gain @ off[..., None])[..., 0]
    return moved, (corrected + np.swapaxes(corrected, 1, 2)) / 2


def born(
    state: Float64[np.ndarray, "6"],
    covariance: Float64[np.ndarray, "6 6"],
    config: MotionConfig,
    shaken_m: float,
) -> tuple[Float64[np.ndarray, "12"], Float64[np.ndarray, "12 12"]]:
    """An object whose outline's middle and velocity are known, with their covariance; arguments as in `predict`."""
    spread = np.zeros((STATE, STATE))
    spread[:6, :6] = covariance
    spread[6:9, 6:9] = config.acceleration**2 * np.eye(3)
    # The body is where the middle is, less what that is off: p = m - e.
    spread[np.ix_([0, 1, 2, 9, 10, 11], [0, 1, 2, 9, 10, 11])] += np.kron(
        shaken_m**2 * np.array([[1, -1], [-1, 1]]), np.eye(3)
    )
    return np.concatenate([state, np.zeros(6)]), spread
