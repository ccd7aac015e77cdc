"""The thesis' protocol for reconstructors: context views on a circle at 20° elevation, targets on a Fibonacci sphere.

Cameras stand at 1.5 times what an object of one metre across needs (§5.5.4), with 50° of view, so an object of any size
fills the images alike. Context images lie over white; light and geometry are the ray caster's, textures included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, UInt8

from aerojax.capture.format import CaptureCamera
from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from aerojax.data.clips import VIEWS
from aerojax.data.views import ViewSet, stacked
from aerojax.pipeline.factory.subjects import Subject
from aerojax.pipeline.factory.views import fibonacci_directions
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.render.scene import SceneRenderer
from aerojax.simulate.world.rigs import aimed_camera

DISTANCE = 2.6
"""From cameras to the object's middle over its reach: within 50° a ball of 1.1 times the reach is whole."""
LIGHT = Dome(colour=(0.0, 0.0, 0.0))
"""Black behind the object, so that its own colour can be told."""


@dataclass(frozen=True)
class ProtocolConfig:
    """What is looked at.

    size: side of all images, pixels. field_deg: their field of view.
    contexts: how many context views; elevation_deg: of them. targets: how many.
    rays_across: as in `ImageConfig`.
    """

    size: int = 128
    field_deg: float = 50.0
    contexts: int = 4
    elevation_deg: float = 20.0
    targets: int = 10
    rays_across: int = 512


def circle_directions(count: int, elevation_deg: float) -> Float64[np.ndarray, "view 3"]:
    """Evenly around the vertical, the first along +X."""
    azimuth, up = 2 * np.pi * np.arange(count) / count, np.deg2rad(elevation_deg)
    flat = np.cos(up)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.full(count, np.sin(up))], axis=1)


def protocol_scenes(subjects: tuple[Subject, ...], config: ProtocolConfig) -> ViewSet:
    """One scene a subject, in the frame of its first context camera's axes."""
    return stacked([_scene(one, config) for one in subjects])


def _scene(subject: Subject, config: ProtocolConfig) -> dict[str, np.ndarray | str]:
    _, middle, reach = subject.posed()
    renderer = SceneRenderer((subject.mesh,), LIGHT, ImageConfig(rays_across=config.rays_across))
    pose = np.eye(4)
    pose[:3, 3] = -middle
    renderer.pose([subject.seconds], pose[None])
    away, size = DISTANCE * reach, config.size
    focal = size / 2 / np.tan(np.deg2rad(config.field_deg) / 2)
    directions = np.concatenate(
        [circle_directions(config.contexts, config.elevation_deg), fibonacci_directions(config.targets)]
    )
    cameras = [aimed_camera(i, away * d, np.zeros(3), focal=focal, size=(size, size)) for i, d in enumerate(directions)]
    shots = [_shot(renderer, camera, away) for camera in cameras]
    rig_from_world = np.eye(4)
    rig_from_world[:3, :3] = cameras[0].world_from_cam[:3, :3].T
    poses = np.stack([rig_from_world @ camera.world_from_cam for camera in cameras]).astype(np.float32)
    K = np.stack([camera.K for camera in cameras]).astype(np.float32)
    parts = {name: np.stack([shot[name] for shot in shots]) for name in shots[0]}
    slots = [*range(config.contexts), *[0] * (VIEWS - config.contexts)]
    last = slice(config.contexts, None)
    return {
        "rgb": parts["over_white"][slots],
        "mask": parts["mask"][slots],
        "valid": np.arange(VIEWS) < config.contexts,
        "K": K[slots],
        "world_from_cam": poses[slots],
        "width_px": _width(parts["mask"][: config.contexts]),
        "target_rgb": parts["rgb"][last],
        "target_mask": parts["mask"][last],
        "target_relief": parts["relief"][last],
        "target_K": K[last],
        "target_world_from_cam": poses[last],
        "name": subject.name,
        "kind": subject.kind,
        "rig": "protocol",
    }


def _shot(renderer: SceneRenderer, camera: CaptureCamera, away: float) -> dict[str, np.ndarray]:
    """One image: colour times coverage, coverage and the same over white as bytes, and depth less the distance."""
    image = renderer.image(camera)
    coverage, depth = image.full("coverage"), image.full("depth")
    light = linear_from_srgb(image.full_rgb()) / np.maximum(coverage, 1e-6)[..., None]
    light = np.where(coverage[..., None] > 0, light, 0.0)
    own = srgb_from_linear(np.clip(light, 0.0, 1.0)) * coverage[..., None]
    white = srgb_from_linear(np.clip(coverage[..., None] * light + 1 - coverage[..., None], 0.0, 1.0))
    return {
        "rgb": np.round(255 * own).astype(np.uint8),
        "mask": np.round(255 * coverage).astype(np.uint8),
        "over_white": np.round(255 * white).astype(np.uint8),
        "relief": np.where(depth > 0, depth - away, 0.0).astype(np.float16),
    }


def _width(masks: UInt8[np.ndarray, "view size size"]) -> Float32[np.ndarray, ""]:
    """Longer side of the object in each image, pixels, median."""
    sides = [max(np.ptp(np.nonzero(mask > 127)[axis]) + 1 for axis in (0, 1)) for mask in masks]
    return np.asarray(np.median(sides), np.float32)
