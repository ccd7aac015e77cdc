"""The viewer's first picture without a script: what it shows until WebGL has started, and where there is none."""

from __future__ import annotations

import math

import cv2
import jax.numpy as jnp
import numpy as np

from aerojax.core.types import SH_C0, Camera, Gaussians
from aerojax.gaussians.render import render
from aerojax.geometry.cameras import look_at
from aerojax.view.encode import data_uri
from aerojax.view.viewer.content import Splats
from aerojax.view.viewer.scene import FIELD_OF_VIEW_DEG, FIRST_PITCH_DEG

WIDTH, HEIGHT = 720, 540


def still_uri(splats: Splats, radius: float, yaw_deg: float) -> str:
    """A transparent WebP of the Gaussians as the viewer's first view shows them, as a data URI.

    Args:
        splats: those of the first frame.
        radius: of the object, metres. yaw_deg: see `scene.first_yaw`.
    """
    drawn = render(_gaussians(splats), _first_camera(radius, yaw_deg))
    alpha = np.clip(np.asarray(drawn.alpha), 0, 1)[..., None]
    rgb = np.clip(np.asarray(drawn.colour) / np.maximum(alpha, 1e-3), 0, 1)
    bgra = np.round(255 * np.concatenate([rgb[..., ::-1], alpha], axis=-1)).astype(np.uint8)
    return data_uri(bgra, "webp", [cv2.IMWRITE_WEBP_QUALITY, 80])


def _gaussians(splats: Splats) -> Gaussians:
    colour = jnp.asarray((splats.rgb[:, None] - 0.5) / SH_C0, jnp.float32)
    mean, quaternion, scale, opacity = map(jnp.asarray, (splats.mean, splats.quaternion, splats.scale, splats.opacity))
    return Gaussians(mean, quaternion, scale, opacity, colour)


def _first_camera(radius: float, yaw_deg: float) -> Camera:
    """As `Orbit.eye` of the viewer's script places it."""
    half = math.radians(FIELD_OF_VIEW_DEG) / 2
    yaw, pitch = math.radians(yaw_deg), math.radians(FIRST_PITCH_DEG)
    towards = np.array([math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), math.sin(pitch)])
    world_from_cam = look_at(towards * radius / math.sin(half), np.zeros(3))
    focal = HEIGHT / 2 / math.tan(half)
    K = np.array([[focal, 0, WIDTH / 2], [0, focal, HEIGHT / 2], [0, 0, 1]])
    return Camera(jnp.asarray(K, jnp.float32), jnp.asarray(world_from_cam, jnp.float32), width=WIDTH, height=HEIGHT)
