"""A small DepthSplat with active weights, and rigs of cameras that look at the origin."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.core.types import Camera, Gaussians, View
from aerojax.geometry.cameras import look_at
from aerojax.reconstruct.depthsplat.config import DepthSplatTinyConfig
from aerojax.reconstruct.depthsplat.network import Prediction
from aerojax.reconstruct.depthsplat.reconstructor import DepthSplat

SMALL = DepthSplatTinyConfig(
    size=32, candidates=8, stem_width=8, half_width=8, width=16, vit_width=24, unet_width=16, head_width=16
)


@functools.cache
def small_depthsplat() -> DepthSplat:
    """Nothing is left at zero: every part speaks."""
    made = SMALL.untrained(key=jax.random.key(0))
    rng = np.random.default_rng(0)
    return jax.tree.map(lambda leaf: leaf + jnp.asarray(0.1 * rng.standard_normal(leaf.shape), leaf.dtype), made)


def rig(views: int, size: int, *, distance: float = 1.5, field: float = 50.0) -> Camera:
    """Cameras around the origin at unequal heights, distances and focal lengths."""
    angles = np.linspace(0.0, 2 * np.pi, views, endpoint=False) + 0.3
    heights = 0.3 + 0.2 * np.cos(np.arange(views))
    centres = np.stack([np.cos(angles), np.sin(angles), heights], axis=-1)
    far = distance * (1 + 0.1 * np.arange(views) / views)
    centres *= (far / np.linalg.norm(centres, axis=-1))[:, None]
    poses = jnp.stack([look_at(jnp.asarray(c, jnp.float32), jnp.zeros(3)) for c in centres])
    focal = size / 2 / np.tan(np.radians(field / 2)) * (1 + 0.05 * np.arange(views))
    K = np.zeros((views, 3, 3), np.float32)
    K[:, 0, 0] = K[:, 1, 1] = focal
    K[:, :2, 2], K[:, 2, 2] = size / 2, 1.0
    return Camera(jnp.asarray(K), poses, size, size)


def disc_views(views: int, size: int) -> View:
    """Noise under round masks."""
    rng = np.random.default_rng(1)
    place = (np.arange(size) + 0.5) / size - 0.5
    disc = (place[:, None] ** 2 + place[None] ** 2 < 0.3**2).astype(np.float32)
    rgb = rng.uniform(0, 1, (views, size, size, 3)).astype(np.float32)
    masks = jnp.broadcast_to(jnp.asarray(disc), (views, size, size))
    return View(jnp.asarray(rgb), masks, rig(views, size))


@jax.jit
def all_of(
    member: DepthSplat, views: View, valid: jax.Array
) -> tuple[Prediction, tuple[Gaussians, jax.Array], Gaussians]:
    """What the member says of every pixel, its call, and its last step: one program for all tests."""
    return member.predict(views, valid), member(views, valid), member.steps(views, valid)[-1]


def predict(member: DepthSplat, views: View, valid: jax.Array) -> Prediction:
    return all_of(member, views, valid)[0]
