"""Which detections of different cameras are one object: rays that meet, each used at most once.

Candidates are grown from pairs of rays: a pair's point is looked for in all other cameras, within what pixel noise,
calibration and the pair's own uncertainty allow. Each candidate's position is the weighted least-squares solution for
all its sights, and its worth the log-likelihood ratio of one object against as many false detections. The candidates
that are kept are the most worth in total among those that share no detection (a weighted set packing, the
multidimensional assignment of Poore 1994, solved exactly as an integer programme).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array

from aerojax.core.config import require_at_least
from aerojax.track.sights import NoiseConfig, TimedCamera, calibration_variance, gate, sight_of_points

NONE = -1
"""No detection of that camera."""
_ROUNDS = 4
"""Gauss-Newton steps; pinhole rays are nearly linear in the point and the first ones arrive."""
Sets = Int64[np.ndarray, "candidate camera"]


@dataclass(frozen=True)
class AssociationConfig:
    """How rays become objects.

    min_views: cameras that must see an object for it to be believed.
    confidence: share of true objects that the gate lets through.
    speed: standard deviation of each component of an object's velocity, m/s, for sights that are not simultaneous.
    nearest, farthest: distances from a camera, metres.
    view_gain: logarithm of how much likelier a sight is of an object near the expected pixel than a false detection.
    miss_loss: the same against an object that a camera should see and does not.
    """

    min_views: int = 3
    confidence: float = 0.999
    speed: float = 15.0
    nearest: float = 0.5
    farthest: float = 2000.0
    view_gain: float = 8.0
    miss_loss: float = 1.5

    def __post_init__(self) -> None:
        require_at_least(self, "min_views", least=2)


@dataclass(frozen=True, eq=False)
class Rays:
    """Sights that may be of the same objects.

    camera: index of each. lag_s: how much later than the moment asked for it was taken.
    pixels: undistorted. variance: of each pixel without the calibration's share.
    """

    camera: Int64[np.ndarray, "sight"]
    lag_s: Float64[np.ndarray, "sight"]
    pixels: Float64[np.ndarray, "sight 2"]
    variance: Float64[np.ndarray, "sight"]


@dataclass(frozen=True, eq=False)
class Candidates:
    """Objects that some sights would be of.

    sights: row of `Rays` by camera, `NONE` where there is none.
    state: position and velocity, metres and m/s, world. covariance: of it.
    misfit: Σ r²/σ² of the pixels and of the velocity against its prior; chi-squared with 2·views - 3 degrees.
    usable: whether it lies before all its cameras, at possible distances.
    """

    sights: Sets
    state: Float64[np.ndarray, "candidate 6"]
    covariance: Float64[np.ndarray, "candidate 6 6"]
    misfit: Float64[np.ndarray, "candidate"]
    usable: np.ndarray

    @property
    def views(self) -> Int64[np.ndarray, "candidate"]:
        """Cameras of each."""
        return np.count_nonzero(self.sights != NONE, axis=1)

    def chosen(self, which: np.ndarray) -> Candidates:
        """Some of them, by index or mask."""
        parts = (self.sights, self.state, self.covariance, self.misfit, self.usable)
        return Candidates(*(part[which] for part in parts))


def associate(rays: Rays, cameras: Sequence[TimedCamera], config: AssociationConfig, noise: NoiseConfig) -> Candidates:
    """The objects that explain the sights best, each sight at most once.

    Args:
        rays: of any cameras, at most one image each.
        cameras: of the network.
        config, noise: see there.

    Returns:
        Objects that at least `min_views` cameras see, in no particular order; perhaps none.
    """
    pairs = _pairs(rays, cameras, config, noise)
    grown = np.unique(_grown(pairs, rays, cameras, config, noise), axis=0)
    sets = _with_parts(grown, config.min_views)
    found = _gated(triangulate_sets(sets, rays, cameras, config, noise), config)
    worth = _worth(found, cameras, config)
    return found.chosen(_packing(found.sights, worth, len(rays.camera)))


def triangulate_sets(
    sets: Sets, rays: Rays, cameras: Sequence[TimedCamera], config: AssociationConfig, noise: NoiseConfig
) -> Candidates:
    """Position and velocity of each set of sights, with covariance.

    Weighted least squares of the pixels by Gauss-Newton, each sight's point at p + v·lag and v with a zero-mean prior;
    the inverse normal matrix is the covariance (Förstner & Wrobel 2016, §4.2).

    Args:
        sets: at least two sights each.
        rays, cameras, config, noise: as in `associate`.
    """
    state = np.zeros((len(sets), 6))
    state[:, :3] = _midpoints(sets, rays, cameras)
    for _ in range(_ROUNDS):
        normal, right, _, usable = _linearised(state, sets, rays, cameras, config, noise)
        step = np.linalg.solve(normal, right[..., None])[..., 0]
        state = state + np.where(usable[:, None], step, 0.0)
    normal, _, misfit, usable = _linearised(state, sets, rays, cameras, config, noise)
    return Candidates(sets, state, np.linalg.inv(normal), misfit, usable)


def _linearised(
    state: Float64[np.ndarray, "candidate 6"],
    sets: Sets,
    rays: Rays,
    cameras: Sequence[TimedCamera],
    config: AssociationConfig,
    noise: NoiseConfig,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Normal matrix, right side, misfit, and whether the point is where it can be."""
    count = len(sets)
    prior = 1 / config.speed**2
    normal = np.tile(np.diag([1e-12, 1e-12, 1e-12, prior, prior, prior]), (count, 1, 1))
    right = np.concatenate([np.zeros((count, 3)), -prior * state[:, 3:]], axis=1)
    misfit = prior * np.sum(state[:, 3:] ** 2, axis=1)
    usable = np.ones(count, bool)
    for index, camera in enumerate(cameras):
        has = sets[:, index] != NONE
        rows = sets[has, index]
        lag = rays.lag_s[rows][:, None]
        pixels, by_point, depth = sight_of_points(state[has, :3] + lag * state[has, 3:], camera)
        variance = rays.variance[rows] + calibration_variance(depth, camera, noise)
        off = rays.pixels[rows] - pixels
        by_state = np.concatenate([by_point, by_point * lag[..., None]], axis=2)
        weighted = by_state / variance[:, None, None]
        normal[has] += np.einsum("ria,rib->rab", weighted, by_state)
        right[has] += np.einsum("ria,ri->ra", weighted, off)
        misfit[has] += np.sum(off**2, axis=1) / variance
        usable[has] &= (depth > config.nearest) & (depth < config.farthest)
    return normal, right, misfit, usable


def _midpoints(sets: Sets, rays: Rays, cameras: Sequence[TimedCamera]) -> Float64[np.ndarray, "candidate 3"]:
    """Nearest points to all rays of each set, metres (Hartley & Sturm 1997, mid-point form for n rays)."""
    anchor = np.mean([camera.world_from_cam[:3, 3] for camera in cameras], axis=0)
    normal, right = np.tile(1e-12 * np.eye(3), (len(sets), 1, 1)), np.zeros((len(sets), 3))
    for index, camera in enumerate(cameras):
        has = sets[:, index] != NONE
        direction = directions(rays.pixels[sets[has, index]], camera)
        projector = np.eye(3) - direction[:, :, None] * direction[:, None, :]
        normal[has] += projector
        right[has] += projector @ (camera.world_from_cam[:3, 3] - anchor)
    return np.linalg.solve(normal, right[..., None])[..., 0] + anchor


def directions(pixels: Float64[np.ndarray, "sight 2"], camera: TimedCamera) -> Float64[np.ndarray, "sight 3"]:
    """Unit vectors through undistorted pixels, world."""
    ahead = np.concatenate([pixels, np.ones((len(pixels), 1))], axis=1) @ np.linalg.inv(camera.K).T
    ahead = ahead @ camera.world_from_cam[:3, :3].T
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


def _gated(found: Candidates, config: AssociationConfig) -> Candidates:
    # By the number of views; of fewer than two there are none.
    limits = np.array([gate(config.confidence, max(2 * views - 3, 1)) for views in range(found.sights.shape[1] + 1)])
    limit = limits[found.views]
    return found.chosen(found.usable & (found.misfit < limit))


def _pairs(rays: Rays, cameras: Sequence[TimedCamera], config: AssociationConfig, noise: NoiseConfig) -> Candidates:
    """Pairs of sights in two cameras whose rays meet (epipolar gate)."""
    first, second = np.triu_indices(len(rays.camera), 1)
    different = rays.camera[first] != rays.camera[second]
    first, second = first[different], second[different]
    sets = np.full((len(first), len(cameras)), NONE)
    rows = np.arange(len(first))
    sets[rows, rays.camera[first]] = first
    sets[rows, rays.camera[second]] = second
    return _gated(triangulate_sets(sets, rays, cameras, config, noise), config)


def _grown(
    pairs: Candidates, rays: Rays, cameras: Sequence[TimedCamera], config: AssociationConfig, noise: NoiseConfig
) -> Sets:
    """Each pair with the nearest sight that it allows in every other camera."""
    sets = pairs.sights.copy()
    limit = gate(config.confidence, 2)
    for index, camera in enumerate(cameras):
        own = np.flatnonzero(rays.camera == index)
        if len(own) == 0:
            continue
        lag = rays.lag_s[own][None, :, None]
        points = pairs.state[:, None, :3] + lag * pairs.state[:, None, 3:]
        pixels, by_point, depth = sight_of_points(points, camera)
        by_state = np.concatenate([by_point, by_point * lag[..., None]], axis=-1)
        spread = by_state @ pairs.covariance[:, None] @ by_state.swapaxes(-1, -2)
        spread += (rays.variance[own] + calibration_variance(depth, camera, noise))[..., None, None] * np.eye(2)
        off = rays.pixels[own] - pixels
        distance = np.einsum("cdi,cdi->cd", off, np.linalg.solve(spread, off[..., None])[..., 0])
        distance[depth <= config.nearest] = np.inf
        nearest = np.argmin(distance, axis=1)
        fits = (distance[np.arange(len(sets)), nearest] < limit) & (pairs.sights[:, index] == NONE)
        sets[fits, index] = own[nearest[fits]]
    return sets


def _with_parts(sets: Sets, min_views: int) -> Int64[np.ndarray, "part camera"]:
    """The sets, and each without one of its sights: one that another object hides behind may be wrong."""
    found = [sets]
    for index in range(sets.shape[1]):
        lacking = sets[sets[:, index] != NONE].copy()
        lacking[:, index] = NONE
        found.append(lacking)
    every = np.unique(np.concatenate(found), axis=0)
    return every[np.count_nonzero(every != NONE, axis=1) >= min_views]


def _worth(
    found: Candidates, cameras: Sequence[TimedCamera], config: AssociationConfig
) -> Float64[np.ndarray, "candidate"]:
    """Log-likelihood ratio of an object against false detections."""
    worth = config.view_gain * found.views - found.misfit / 2
    for index, camera in enumerate(cameras):
        pixels, _, depth = sight_of_points(found.state[:, :3], camera)
        inside = (depth > config.nearest) & np.all((pixels > 0) & (pixels < [camera.width, camera.height]), axis=1)
        worth -= config.miss_loss * (inside & (found.sights[:, index] == NONE))
    return worth


def _packing(sets: Sets, worth: Float64[np.ndarray, "candidate"], sights: int) -> Int64[np.ndarray, "kept"]:
    """Indices of the sets of most worth in total that share no sight."""
    good = np.flatnonzero(worth > 0)
    if len(good) == 0:
        return good
    rows, columns = np.nonzero(sets[good] != NONE)
    uses = csr_array((np.ones(len(rows)), (sets[good][rows, columns], rows)), shape=(sights, len(good)))
    if np.all(uses.sum(axis=1) <= 1):
        return good
    once = LinearConstraint(uses, ub=1.0)
    solved = milp(-worth[good], integrality=np.ones(len(good)), bounds=Bounds(0, 1), constraints=once)
    if solved.x is None:
        return _greedy(sets, worth, good)
    return good[solved.x > 0.5]


def _greedy(
    sets: Sets, worth: Float64[np.ndarray, "candidate"], good: Int64[np.ndarray, "good"]
) -> Int64[np.ndarray, "kept"]:
    """The best set that is left, again and again; where the solver gives up."""
    used: set[int] = set()
    kept = []
    for index in good[np.argsort(-worth[good], kind="stable")]:
        own = set(sets[index][sets[index] != NONE].tolist())
        if not own & used:
            used |= own
            kept.append(int(index))
    return np.array(kept, np.int64)


def concatenated(parts: Sequence[Rays]) -> Rays:
    """Rays of several images."""
    columns = ("camera", "lag_s", "pixels", "variance")
    return Rays(*(np.concatenate([getattr(part, name) for part in parts]) for name in columns))
