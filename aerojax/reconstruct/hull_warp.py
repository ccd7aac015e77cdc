"""The visual hull for worker processes: the Warp counterpart of `aerojax.reconstruct.hull`.

It compiles nothing per shape and takes a third of the twin's time on one core; the twin runs within `jax.jit`.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float32

from aerojax.core.types import SH_C0, Gaussians, View
from aerojax.reconstruct.hull import HullConfig, cam_from_world_rows
from kernels.hull.launch import Grid, Silhouettes, Surface, empty_surface, hull_surface


def hull_of_crops(
    views: View, valid: Bool[np.ndarray, "view"], *, config: HullConfig, device: str = "cpu"
) -> tuple[Gaussians, int, float]:
    """As `aerojax.reconstruct.hull.visual_hull`, in the same order and equal to rounding; for concrete values only.

    Args:
        views: float32 crops (leading axis `view`) whose cameras stand in a frame with the object near its origin,
            metres. Arrays of the host, JAX's or NumPy's, are not copied.
        valid: views that count; the others constrain nothing.
        config: resolution.
        device: Warp's name of it, such as `cpu` or `cuda:0`.

    Returns:
        Gaussians, `config.capacity` of them, of which the first `count` are real and the rest repeat the first, or are
        all zero where the masks meet nowhere; `count`; the grid's cell size, metres (0 where no view counts).
    """
    if not valid.any():
        return _padded(empty_surface(), config), 0, 0.0
    rows = slice(None) if valid.all() else valid
    camera = views.camera
    rgb, mask, K, pose = (
        np.asarray(leaf, np.float32)[rows] for leaf in (views.rgb, views.mask, camera.K, camera.world_from_cam)
    )
    known = None if views.known is None else np.asarray(views.known)[rows]
    cell = _cell_size(K, pose, camera.width, config)
    seen = Silhouettes(rgb, mask, K, cam_from_world_rows(pose), pose[:, :3, 3], known)
    surface = hull_surface(seen, Grid(config.grid, cell, config.capacity, config.dilation), device=device)
    return _padded(surface, config), len(surface.mean), cell


def _cell_size(
    K: Float32[np.ndarray, "view 3 3"], world_from_cam: Float32[np.ndarray, "view 4 4"], width: int, config: HullConfig
) -> float:
    """See the twin's."""
    depth = np.linalg.norm(world_from_cam[:, :3, 3], axis=-1)
    widest = np.max(depth * np.float32(width) / K[:, 0, 0])
    return float(np.float32(config.extent) * widest / np.float32(config.grid))


def _padded(surface: Surface, config: HullConfig) -> Gaussians:
    count = len(surface.mean)

    def fill(values: Float32[np.ndarray, "count column"]) -> Float32[np.ndarray, "gaussian column"]:
        whole = np.zeros((config.capacity, values.shape[1]), np.float32)
        whole[:count] = values
        if count:
            whole[count:] = values[0]
        return whole

    sh = ((fill(surface.colour) - np.float32(0.5)) / np.float32(SH_C0))[:, None]
    opacity = np.full(config.capacity, config.opacity, np.float32)
    columns = fill(surface.mean), fill(surface.quaternion), fill(surface.scale), opacity, sh
    return Gaussians(*(jnp.asarray(column) for column in columns))
