"""Scenes of views without a simulator: coloured balls of Gaussians, seen from all around."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.core.types import Camera, Gaussians
from aerojax.data.views import ViewSet, stacked
from aerojax.gaussians.render import Rendering, render
from aerojax.geometry.cameras import look_at

DISTANCE = 3.0


def ball(key, count=60, radius=0.35) -> Gaussians:
    """Opaque Gaussians on a sphere, their colours by place."""
    place = jax.random.normal(key, (count, 3))
    place = radius * place / jnp.linalg.norm(place, axis=-1, keepdims=True)
    quaternion = jnp.broadcast_to(jnp.eye(4)[0], (count, 4))
    return Gaussians(place, quaternion, jnp.full((count, 3), 0.08), jnp.full(count, 0.95), (place / radius)[:, None, :])


def cameras_around(count: int, size: int, turn: float = 0.0) -> Camera:
    """On a spiral about the origin."""
    angle = turn + 2.4 * np.arange(count)
    height = np.linspace(-0.6, 0.6, count)
    away = np.stack([np.cos(angle), np.sin(angle), height], axis=1)
    away = DISTANCE * away / np.linalg.norm(away, axis=1, keepdims=True)
    poses = jnp.stack([look_at(jnp.asarray(a, jnp.float32), jnp.zeros(3)) for a in away])
    focal = size * DISTANCE / 1.2
    K = jnp.array([[focal, 0.0, size / 2], [0.0, focal, size / 2], [0.0, 0.0, 1.0]])
    return Camera(jnp.broadcast_to(K, (count, 3, 3)), poses, size, size)


@jax.jit
def shown(gaussians: Gaussians, cameras: Camera, behind: float) -> Rendering:
    return render(gaussians, cameras, background=jnp.full(3, behind), antialias=True)


def ball_scenes(count: int, *, size: int = 32, views: int = 4, targets: int = 3) -> ViewSet:
    """Scenes of balls; their targets are the balls' own renderings."""
    scenes = []
    for number in range(count):
        gaussians = ball(jax.random.key(number))
        context, target = cameras_around(views, size, 0.3 * number), cameras_around(targets, size, 1.0 + number)
        seen, true = shown(gaussians, context, 1.0), shown(gaussians, target, 0.0)
        alpha = np.asarray(true.alpha)
        relief = np.where(alpha > 0.5, np.asarray(true.depth) / np.maximum(alpha, 1e-3) - DISTANCE, 0.0)
        slots = [*range(views), *[0] * (8 - views)]
        scenes.append(
            {
                "rgb": to_bytes(seen.colour)[slots],
                "mask": to_bytes(seen.alpha)[slots],
                "valid": np.arange(8) < views,
                "K": np.asarray(context.K)[slots],
                "world_from_cam": np.asarray(context.world_from_cam)[slots],
                "width_px": np.float32(20.0),
                "target_rgb": to_bytes(true.colour),
                "target_mask": to_bytes(true.alpha),
                "target_relief": relief.astype(np.float16),
                "target_K": np.asarray(target.K),
                "target_world_from_cam": np.asarray(target.world_from_cam),
                "name": f"ball_{number}",
                "kind": "solid",
                "rig": "free",
            }
        )
    return stacked(scenes)


def to_bytes(values) -> np.ndarray:
    return np.round(255 * np.clip(np.asarray(values), 0, 1)).astype(np.uint8)
