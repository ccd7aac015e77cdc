"""How near reconstructed Gaussians come to the object: images from elsewhere, silhouettes, and the surface itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64, Int
from scipy.spatial import KDTree

from aerojax.core.images import dilate, peak_signal_to_noise, structural_similarity
from aerojax.core.types import Camera, Gaussians, View, pytree_dataclass
from aerojax.data.views import ViewSet
from aerojax.evaluate.perceptual import Perceptual
from aerojax.gaussians.render import render
from aerojax.geometry.cameras import unproject_depth

SURROUND = 32
"""Pixels of an image's width for each pixel around the mask in which a shape that is too fat shows."""
SOLID_OPACITY = 0.3
"""Gaussians fainter than this are no surface."""
MOST_POINTS = 8192
"""Of either surface in a Chamfer distance; more are thinned evenly."""
HIGHER_IS_BETTER = ("psnr_db", "surround_psnr_db", "full_psnr_db", "ssim", "iou")
FIGURES = (*HIGHER_IS_BETTER, "perceptual", "chamfer_percent", "gaussians")
"""Figures of a scene in the order of tables; `perceptual` where a distance is named."""


@dataclass(frozen=True, eq=False)
class _Exact:
    """A pinhole of the host, in double precision."""

    K: Float64[np.ndarray, "3 3"]
    world_from_cam: Float64[np.ndarray, "4 4"]


@pytree_dataclass
class TargetImages:
    """Images that Gaussians are compared with, over white.

    image: sRGB. mask: coverage. camera: of each.
    """

    image: Float[Array, "target size size 3"]
    mask: Float[Array, "target size size"]
    camera: Camera


def views_at(scenes: ViewSet, index: int) -> tuple[View, np.ndarray]:
    """The context views of one scene, and which count."""
    rgb, mask = (jnp.asarray(values[index], jnp.float32) / 255.0 for values in (scenes.rgb, scenes.mask))
    camera = Camera(jnp.asarray(scenes.K[index]), jnp.asarray(scenes.world_from_cam[index]), scenes.size, scenes.size)
    return View(rgb, mask, camera), scenes.valid[index]


def targets_at(scenes: ViewSet, index: int) -> TargetImages:
    """The targets of one scene over white."""
    rgb, mask = (jnp.asarray(v[index], jnp.float32) / 255.0 for v in (scenes.target_rgb, scenes.target_mask))
    pose = jnp.asarray(scenes.target_world_from_cam[index])
    camera = Camera(jnp.asarray(scenes.target_K[index]), pose, scenes.size, scenes.size)
    return TargetImages(rgb + 1.0 - mask[..., None], mask, camera)


def true_surface(scenes: ViewSet, index: int) -> Float64[np.ndarray, "point 3"]:
    """Points of the surface that the targets see, metres, crop frame."""
    points = []
    for target in range(scenes.target_mask.shape[1]):
        K, pose = scenes.target_K[index, target], scenes.target_world_from_cam[index, target].astype(np.float64)
        rows, columns = np.nonzero(scenes.target_mask[index, target] > 127)
        relief = scenes.target_relief[index, target][rows, columns].astype(np.float64)
        pixels = np.stack([columns, rows], axis=1) + 0.5
        camera = _Exact(K.astype(np.float64), pose)
        points.append(unproject_depth(pixels, relief + np.linalg.norm(pose[:3, 3]), camera))
    return np.concatenate(points)


def scene_figures(
    gaussians: Gaussians,
    count: int,
    targets: TargetImages,
    surface: Float64[np.ndarray, "point 3"],
    perceptual: Perceptual | None,
) -> tuple[dict[str, float], Float[np.ndarray, "target size size 3"]]:
    """Figures of one reconstruction, and its renderings in the targets' cameras.

    Args:
        gaussians: of which the first `count` are real; none give a white image.
        targets: images of the same object.
        surface: of it, for the Chamfer distance, which is in per cent of the longest side of the surface's box.
        perceptual: the distance of whole images; None leaves it out.
    """
    seen, compared = _compared(gaussians, count, targets)
    found: dict[str, float] = {name: float(value) for name, value in compared.items()}
    if perceptual is not None:
        found["perceptual"] = float(jnp.mean(perceptual(seen, targets.image)))
    solid = np.asarray(gaussians.mean, np.float64)[:count][np.asarray(gaussians.opacity)[:count] > SOLID_OPACITY]
    found["chamfer_percent"] = 100.0 * chamfer(solid, surface) / float(np.ptp(surface, axis=0).max())
    return {**found, "gaussians": float(count)}, np.asarray(seen)


@jax.jit
def _compared(
    gaussians: Gaussians, count: int | Int[Array, ""], targets: TargetImages
) -> tuple[Float[Array, "target size size 3"], dict[str, Float[Array, ""]]]:
    """Renderings, 0..1, and figures that need no surface."""
    real = jnp.arange(len(gaussians.opacity)) < count
    shown = replace(gaussians, opacity=jnp.where(real, gaussians.opacity, 0.0))
    seen = render(shown, targets.camera, background=jnp.ones(3), antialias=True)
    colour = jnp.clip(seen.colour, 0.0, 1.0)
    around = dilate((targets.mask > 0.5).astype(targets.mask.dtype), max(targets.camera.width // SURROUND, 1))

    def psnr(mask: Array) -> Array:
        return jnp.mean(jax.vmap(peak_signal_to_noise)(colour, targets.image, mask))

    drawn, true = seen.alpha > 0.5, targets.mask > 0.5
    overlap, union = (jnp.sum(op(drawn, true), axis=(1, 2)) for op in (jnp.logical_and, jnp.logical_or))
    return colour, {
        "psnr_db": psnr(targets.mask),
        "surround_psnr_db": psnr(around),
        "full_psnr_db": psnr(jnp.ones_like(targets.mask)),
        "ssim": structural_similarity(colour, targets.image),
        "iou": jnp.mean(overlap / jnp.maximum(union, 1)),
    }


def chamfer(a: Float64[np.ndarray, "point 3"], b: Float64[np.ndarray, "other 3"]) -> float:
    """Mean of the mean distances from each set's points to the other set, metres; the other's size if one is empty."""
    if not len(a) or not len(b):
        return float(np.ptp(np.concatenate([a, b]), axis=0).max()) if len(a) + len(b) else 0.0
    a, b = (points[:: max(1, len(points) // MOST_POINTS)] for points in (a, b))
    return float(np.mean([KDTree(a).query(b)[0].mean(), KDTree(b).query(a)[0].mean()]))


def mean_figures(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Means over scenes, and the standard error of the foreground PSNR."""
    means = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
    spread = np.std([row["psnr_db"] for row in rows], ddof=1) / np.sqrt(len(rows)) if len(rows) > 1 else 0.0
    return {**means, "psnr_standard_error": float(spread)}


def binned(
    rows: Sequence[Mapping[str, Any]], by: str, edges: Sequence[float], figure: str = "psnr_db"
) -> list[dict[str, float]]:
    """Means of a figure over scenes in bins of another one, lower edge included; bins without a scene are left out."""
    found = []
    for low, high in pairwise(edges):
        inside = [row[figure] for row in rows if low <= row[by] < high]
        if inside:
            found.append({"from": low, "to": high, "scenes": float(len(inside)), figure: float(np.mean(inside))})
    return found
