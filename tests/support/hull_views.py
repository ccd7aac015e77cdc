"""Crops of spheres, rods and simulated objects, as the visual hull gets them."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import Camera, View
from aerojax.geometry.cameras import look_at, project_points
from aerojax.simulate.assets.catalogue import build_identity
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.render.scene import SceneRenderer
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

SIZE = 96
DISTANCE, HALF_WIDTH = 20.0, 0.7  # the crop window's half side at the object, metres


def rig(views, *, elevation=0.35):
    """Crop cameras on a ring, alternately above and below."""
    azimuth = 0.3 + 2 * np.pi * np.arange(views) / views
    height = elevation * np.where(np.arange(views) % 2, -1.0, 1.0)
    away = np.stack([np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)], axis=1)
    poses = jnp.stack([look_at(jnp.asarray(DISTANCE * d, jnp.float32), jnp.zeros(3)) for d in away])
    focal = SIZE / 2 * DISTANCE / HALF_WIDTH
    K = jnp.array([[focal, 0.0, SIZE / 2], [0.0, focal, SIZE / 2], [0.0, 0.0, 1.0]])
    return Camera(jnp.broadcast_to(K, (views, 3, 3)), poses, SIZE, SIZE)


def pixel_centres():
    along = jnp.arange(SIZE, dtype=jnp.float32) + 0.5
    return jnp.stack(jnp.meshgrid(along, along, indexing="xy"), axis=-1)


def pixel_directions(camera):
    grid = pixel_centres().reshape(-1, 2)
    in_camera = jnp.concatenate([(grid - SIZE / 2) / camera.K[0, 0], jnp.ones((SIZE * SIZE, 1))], axis=-1)
    along = in_camera @ camera.world_from_cam[:3, :3].T
    return along / jnp.linalg.norm(along, axis=-1, keepdims=True)


def sphere_mask(camera, radius, centre=(0.0, 0.0, 0.0)):
    """The exact silhouette of a sphere: rays that pass within its radius."""
    away = jnp.asarray(centre) - camera.world_from_cam[:3, 3]
    directions = pixel_directions(camera)
    closest = away[None] - (directions @ away)[:, None] * directions
    return (jnp.linalg.norm(closest, axis=-1) < radius).astype(jnp.float32).reshape(SIZE, SIZE)


def rod_mask(camera, ends, radius):
    """The silhouette of a capsule about a segment, by the projected axis and width."""
    pixels = project_points(jnp.asarray(ends), camera)
    grid = pixel_centres()
    along = pixels[1] - pixels[0]
    from_end = grid - pixels[0][None, None]
    share = jnp.clip((from_end @ along) / (along @ along), 0, 1)
    gap = jnp.linalg.norm(from_end - share[..., None] * along[None, None], axis=-1)
    return (gap < radius * camera.K[0, 0] / DISTANCE).astype(jnp.float32)


def one(cameras, index):
    return Camera(cameras.K[index], cameras.world_from_cam[index], SIZE, SIZE)


def views_of(cameras, mask_of, colour=(0.2, 0.5, 0.7)):
    masks = jnp.stack([mask_of(one(cameras, i)) for i in range(cameras.K.shape[0])])
    rgb = jnp.where(masks[..., None] > 0.5, jnp.asarray(colour)[None, None, None], 1.0)
    return View(rgb, masks, cameras)


def mesh_views(identity, folder, cameras):
    """Crops of a simulated object at rest at the origin, and its vertices."""
    mesh = load_animated_mesh(build_identity(identity, folder))
    vertices = mesh.vertices_at(0.3)
    renderer, masks = SceneRenderer((mesh,), Dome(), ImageConfig()), []
    renderer.pose([0.3], np.eye(4)[None])
    for index in range(cameras.K.shape[0]):
        camera = one(cameras, index)
        K, pose = (np.asarray(array, np.float64) for array in (camera.K, camera.world_from_cam))
        seen = CaptureCamera(f"cam_{index}", SIZE, SIZE, K, "none", (), pose, "{frame}.png", None, None, 0.0)
        masks.append((renderer.image(seen).full("mask") > 0).astype(np.float32))
    masks = jnp.asarray(np.stack(masks))
    return View(jnp.ones((*masks.shape, 3)), masks, cameras), vertices[np.unique(mesh.faces)]
