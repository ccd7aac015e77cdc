"""EWA splatting in plain NumPy and double precision, written from the publications: no JAX, no Warp, none of our code.

Zwicker et al. 2001 (Eq. 24-33), Kerbl et al. 2023 (§4-6 and the published rasteriser's rules) and gsplat 1.5
(Ye et al. 2024). One Gaussian after another, over whole images; gradients are central differences.

    PYTHONPATH=tests python -m support.splat_numpy   # writes tests/parity/data/splat/*.npz anew
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

FOLDER = Path(__file__).resolve().parents[1] / "parity" / "data" / "splat"
INPUTS = ("mean", "quaternion", "scale", "opacity", "colour", "K", "camera_from_world", "background")
TILE, NEAR, VISIBLE, STOP = 16, 0.2, 1 / 255, 1e-4
CONSTANT = {
    "K": ((0, 1), (1, 0), (2, 0), (2, 1), (2, 2)),
    "camera_from_world": ((3, 0), (3, 1), (3, 2), (3, 3)),
}
"""Entries of the camera's matrices that are no parameters."""
STEP = 1e-6
"""Of the central differences; rounding then costs 1e-10 of a loss of about one."""
FRAGILE = 1e-4
"""A pixel where a decision is nearer than this to its threshold (relatively) has no derivative worth comparing."""


@dataclass(frozen=True)
class Scene:
    """What is drawn with which rules."""

    rules: str
    antialias: bool
    width: int
    height: int
    inputs: dict[str, np.ndarray]


@dataclass(frozen=True)
class Drawn:
    """Colour, depth and alpha as one array (height, width, 5); which pixels are fragile; which tiles each splat has."""

    image: np.ndarray
    fragile: np.ndarray
    tiles: np.ndarray


def ratio_limits(focal: float, principal: float, side: int, rules: str) -> tuple[float, float]:
    """Between which X/Z (or Y/Z) the projection is linearised."""
    tangent = side / (2 * focal)
    if rules == "inria":
        return -1.3 * tangent, 1.3 * tangent
    return -principal / focal - 0.3 * tangent, (side - principal) / focal + 0.3 * tangent


def image_covariance(scene: Scene, index: int, point: np.ndarray) -> np.ndarray:
    """J W Σ Wᵀ Jᵀ of one Gaussian at `point` of the camera's frame, square pixels, not yet blurred."""
    x = scene.inputs
    turn = Rotation.from_quat(x["quaternion"][index], scalar_first=True).as_matrix()
    sigma = turn @ np.diag(x["scale"][index] ** 2) @ turn.T
    W, K, z = x["camera_from_world"][:3, :3], x["K"], point[2]
    jacobian = np.zeros((2, 3))
    for axis, side in ((0, scene.width), (1, scene.height)):
        ratio = np.clip(point[axis] / z, *ratio_limits(K[axis, axis], K[axis, 2], side, scene.rules))
        jacobian[axis, axis] = K[axis, axis] / z
        jacobian[axis, 2] = -K[axis, axis] * ratio / z
    return jacobian @ W @ sigma @ W.T @ jacobian.T


def tile_range(centre: np.ndarray, blurred: np.ndarray, opacity: float, scene: Scene) -> np.ndarray:
    """First tile (x, y) and the one after the last, cut to the image."""
    most = np.ceil(np.array([scene.width, scene.height]) / TILE)
    if scene.rules == "inria":
        middle = np.trace(blurred) / 2
        largest = middle + np.sqrt(max(0.1, middle**2 - np.linalg.det(blurred)))
        radius, corner = np.ceil(3 * np.sqrt(largest)), centre - 0.5
        low, high = np.floor((corner - radius) / TILE), np.floor((corner + radius + TILE - 1) / TILE)
    else:
        sigmas = min(3.33, np.sqrt(2 * np.log(max(opacity / VISIBLE, 1.0))))
        radius = np.ceil(sigmas * np.sqrt(np.diag(blurred)))
        low, high = np.floor((centre - radius) / TILE), np.ceil((centre + radius) / TILE)
        if opacity < VISIBLE:
            high = low
    return np.concatenate([np.clip(low, 0, most), np.clip(high, 0, most)])


def draw(scene: Scene) -> Drawn:
    """Blend front to back, pixel centres at (0.5, 0.5) and on."""
    x = scene.inputs
    points = x["mean"] @ x["camera_from_world"][:3, :3].T + x["camera_from_world"][:3, 3]
    most = 0.99 if scene.rules == "inria" else 0.999
    v, u = np.mgrid[: scene.height, : scene.width] + 0.5
    left, ended = np.ones(u.shape), np.zeros(u.shape, bool)
    fragile, image = np.zeros(u.shape, bool), np.zeros((*u.shape, 5))
    tiles = np.zeros((len(points), 4))
    for i in np.argsort(points[:, 2], kind="stable"):
        if points[i, 2] <= NEAR:
            continue
        sharp = image_covariance(scene, i, points[i])
        blurred = sharp + 0.3 * np.eye(2)
        opacity = x["opacity"][i]
        if scene.antialias:
            opacity = opacity * np.sqrt(max(np.linalg.det(sharp) / np.linalg.det(blurred), 0.005**2))
        centre = (x["K"] @ points[i])[:2] / points[i, 2]
        tiles[i] = tile_range(centre, blurred, opacity, scene)
        x0, y0, x1, y1 = tiles[i]
        near = (u // TILE >= x0) & (u // TILE < x1) & (v // TILE >= y0) & (v // TILE < y1) & ~ended
        d = np.stack([u - centre[0], v - centre[1]], axis=-1)
        raw = opacity * np.exp(-0.5 * np.einsum("...i,ij,...j->...", d, np.linalg.inv(blurred), d))
        seen = near & (raw >= VISIBLE)
        alpha = np.where(seen, np.minimum(raw, most), 0.0)
        after = left * (1 - alpha)
        for value, threshold in ((raw, VISIBLE), (raw, most), (after, STOP)):
            fragile |= near & (np.abs(value / threshold - 1) < FRAGILE)
        ended |= seen & ((after < STOP) if scene.rules == "inria" else (after <= STOP))
        weight = np.where(ended, 0.0, alpha * left)
        image += weight[..., None] * np.array([*x["colour"][i], points[i, 2], 0.0])
        left = np.where(ended, left, after)
    image[..., :3] += left[..., None] * x["background"]
    image[..., 4] = 1 - left
    return Drawn(image, fragile, tiles)


def loss_weights(fragile: np.ndarray) -> np.ndarray:
    """Weights (height, width, 5) of the loss whose gradient is stored: irregular numbers, 0 where fragile."""
    index = np.arange(fragile.size * 5, dtype=np.float64).reshape(*fragile.shape, 5)
    return np.sin(1 + 12.9898 * index) * ~fragile[..., None]


def gradients(scene: Scene) -> dict[str, np.ndarray]:
    """Central differences of Σ weights · image to every number of the inputs; constants of the matrices have 0."""
    here = draw(scene)
    weights = loss_weights(here.fragile)
    found = {}
    for name, array in scene.inputs.items():
        slope = np.zeros(array.shape)
        for place in np.ndindex(array.shape):
            if place in CONSTANT.get(name, ()):
                continue
            either = []
            for sign in (1, -1):
                moved = array.copy()
                moved[place] += sign * STEP
                there = draw(Scene(**{**vars(scene), "inputs": scene.inputs | {name: moved}}))
                assert np.array_equal(there.tiles, here.tiles), f"a tile border lies within a step of {name}{place}"
                either.append(np.sum(weights * there.image))
            slope[place] = (either[0] - either[1]) / (2 * STEP)
        found[name] = slope
    return found


def make_scene(seed: int, rules: str, antialias: bool, *, spread: float, sigma: tuple, opacity: tuple) -> Scene:
    """Eighteen Gaussians around the origin, seen from 1.5 m in an image that is no multiple of the tile."""
    rng = np.random.default_rng(seed)
    count, (width, height) = 18, (21, 18)
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    camera_from_world[:3, 3] = (0.05, -0.1, 1.5)
    inputs = {
        "mean": rng.normal(0, spread, (count, 3)),
        "quaternion": rng.normal(size=(count, 4)),
        "scale": np.exp(rng.uniform(*np.log(sigma), (count, 3))),
        "opacity": rng.uniform(*opacity, count),
        "colour": rng.uniform(size=(count, 3)),
        "K": np.array([[22.0, 0, 9.7], [0, 25.0, 8.6], [0, 0, 1]]),
        "camera_from_world": camera_from_world,
        "background": np.array([0.9, 0.2, 0.4]),
    }
    return Scene(rules, antialias, width, height, inputs)


SCENES = {
    "inria": make_scene(0, "inria", False, spread=0.7, sigma=(0.03, 0.15), opacity=(0.05, 0.9)),
    "inria_opaque": make_scene(1, "inria", False, spread=0.3, sigma=(0.3, 0.8), opacity=(0.994, 1.0)),
    "gsplat_small": make_scene(2, "gsplat", True, spread=0.3, sigma=(0.005, 0.05), opacity=(0.3, 1.0)),
    "gsplat_wide": make_scene(3, "gsplat", False, spread=0.9, sigma=(0.1, 0.4), opacity=(0.3, 1.0)),
}


def write() -> None:
    """Remake the stored scenes."""
    for name, scene in SCENES.items():
        drawn = draw(scene)
        slopes = {f"gradient_{key}": value for key, value in gradients(scene).items()}
        settings = {"rules": scene.rules, "antialias": scene.antialias, "width": scene.width, "height": scene.height}
        stored = {**settings, **scene.inputs, "image": drawn.image, "fragile": drawn.fragile, "tiles": drawn.tiles}
        FOLDER.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(FOLDER / f"{name}.npz", **stored, **slopes)


if __name__ == "__main__":
    write()
