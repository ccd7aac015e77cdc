"""Views whose silhouettes do not meet, shifted until they do: what is left to see where calibration or clocks are off.

A camera that is turned by a little, or whose clock is late, shows the object displaced; the outlines keep their shape.
The epipolar tangency constraint tells by how much, whatever that shape is (Cipolla & Giblin 2000, ch. 5): the planes
through two cameras' centres that touch the outline in one image touch it in the other. Of all displacements that
restore it the smallest are taken; a part that all cameras share moves the object and is not seen.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float64

from aerojax.core.types import Gaussians, View
from aerojax.reconstruct.consistency import Consistency, consistency, uncovered_shares

MOST_UNCOVERED = 0.25
"""Share of the silhouettes, median over the cameras, that a reconstruction may leave bare before shifts are tried."""
MOST_SHIFT = 3.0
"""Object sizes by which a camera's picture may be displaced; what is further away is another object."""
_ROUNDS = 3
"""Tangent planes turn as the cameras move: after three rounds the rest is far below a pixel."""


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """What was made of one frame's views.

    gaussians: a fixed number, the first `count` of them real; 0 where the silhouettes meet in no way.
    uncovered: share of each silhouette that is left bare with the cameras as they are stated.
    shift_m: by which each camera's picture was taken to be displaced, metres at the object; 0 where the silhouettes
        fit as they are.
    """

    gaussians: Gaussians
    count: int
    uncovered: Float64[np.ndarray, "camera"]
    shift_m: Float64[np.ndarray, "camera"]


def reconstruct_aligned(
    reconstruct: Callable[[View], tuple[Gaussians, int]],
    views: View,
    valid: Bool[np.ndarray, "camera"],
    *,
    whole: Bool[np.ndarray, "camera"] | None = None,
    stage: Callable[[str], AbstractContextManager[None]] = lambda _: nullcontext(),
) -> Reconstruction:
    """Reconstruct views as they are, and shifted if much of the silhouettes is left bare.

    Args:
        reconstruct: of views; 0 Gaussians where they do not meet.
        views: crops that look at the frame's origin, metres.
        valid: cameras that count.
        whole: those of them that show the whole object, which alone can be compared and shifted; None for all.
        stage: measures the time of "reconstruct" and "align".
    """
    with stage("reconstruct"):
        found, count = reconstruct(views)
        uncovered = uncovered_shares(views, valid, np.asarray(found.mean)[:count])
    as_stated = Reconstruction(found, count, uncovered, np.zeros(len(valid)))
    if np.nanmedian(uncovered) <= MOST_UNCOVERED:
        return as_stated
    with stage("align"):
        shift = misplaced(views, valid if whole is None else whole)
        if shift is None:
            return as_stated
        back = _shifted(views, shift)
        found, count = reconstruct(back)
        left = uncovered_shares(back, valid, np.asarray(found.mean)[:count])
    if np.nanmedian(left) > 0.5 * np.nanmedian(uncovered):
        return as_stated
    return Reconstruction(found, count, uncovered, np.linalg.norm(shift, axis=1))


def misplaced(views: View, valid: Bool[np.ndarray, "camera"]) -> Float64[np.ndarray, "camera 3"] | None:
    """By how much each camera's picture of the object is displaced, metres at the object, across its central ray.

    Arguments as for `reconstruct_aligned`. None where one is displaced by more than `MOST_SHIFT` object sizes, and
    where no two cameras can be compared.
    """
    total, size = np.zeros((len(valid), 3)), np.inf
    focal, unknown = np.asarray(views.camera.K[:, 0, 0], np.float64), np.full(len(valid), np.nan)
    for _ in range(_ROUNDS):
        seen = consistency(_shifted(views, total), valid, focal, unknown)
        if not seen.tangencies:
            return None
        size = min(size, seen.lines.size)
        total += _smallest_displacements(seen)
        if not np.linalg.norm(total, axis=1).max() <= MOST_SHIFT * size:
            return None
    return total


def _smallest_displacements(seen: Consistency) -> Float64[np.ndarray, "camera 3"]:
    """Least squares of both ends of every pair of outlines; the smallest ones of equally good ones."""
    cameras = len(seen.lines.valid)
    design, ends = np.zeros((2 * len(seen.tangencies), cameras, 2)), np.zeros(2 * len(seen.tangencies))
    for n, pair in enumerate(seen.tangencies):
        for camera, sign in ((pair.first, 1.0), (pair.second, -1.0)):
            design[2 * n : 2 * n + 2, camera] = sign * seen.lines.across[camera] @ pair.normal
        ends[2 * n : 2 * n + 2] = pair.ends
    # The object's own place is free: three directions that no pair sees are cut off.
    found = np.linalg.lstsq(design.reshape(len(ends), -1), ends, rcond=1e-3)[0].reshape(cameras, 2)
    return np.einsum("ca,cak->ck", found, seen.lines.across)


def _shifted(views: View, shift: Float64[np.ndarray, "camera 3"]) -> View:
    """The same pictures of cameras that are moved back by what they are displaced by."""
    pose = views.camera.world_from_cam
    moved = pose.at[:, :3, 3].add(jnp.asarray(-shift, pose.dtype))
    return replace(views, camera=replace(views.camera, world_from_cam=moved))
