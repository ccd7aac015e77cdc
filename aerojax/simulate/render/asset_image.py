"""Pictures of one asset by itself: for contact sheets and for statistics of its colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from aerojax.core.colour import srgb_from_linear
from aerojax.geometry.cameras import look_at
from aerojax.simulate.render.image import INTERIOR_SAMPLES
from aerojax.simulate.render.surfaces import scene_caster
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from kernels.rays.footprint import CROSSED
from kernels.rays.raytrace import Lighting, Pinhole

DISTANCE = 6.0
"""Metres from the camera to the asset, whose size is one metre: little perspective."""


@dataclass(frozen=True)
class AssetImage:
    """What a camera sees of an asset: linear colour of the covered part of each pixel, and the share covered, 0..1."""

    linear: Float[np.ndarray, "row column 3"]
    coverage: Float[np.ndarray, "row column"]

    def over(self, backdrop: float) -> Float[np.ndarray, "row column 3"]:
        """Linear picture in front of a grey backdrop."""
        return self.coverage[..., None] * self.linear + (1 - self.coverage[..., None]) * backdrop


def srgb_bytes(linear: Float[np.ndarray, "row column 3"]) -> UInt8[np.ndarray, "row column 3"]:
    """A linear picture as sRGB bytes."""
    return np.rint(255 * srgb_from_linear(linear.clip(0.0, 1.0)).astype(np.float32)).astype(np.uint8)


class AssetRenderer:
    """An asset ready to be pictured from anywhere, at any time of its animation."""

    def __init__(self, mesh: AnimatedMesh):
        self._mesh = mesh
        self._caster = scene_caster((mesh,))

    def image(
        self,
        seconds: float,
        azimuth: float,
        elevation: float,
        *,
        width: int,
        height: int,
        lighting: Lighting,
        samples: int = 3,
    ) -> AssetImage:
        """Picture the asset so that it fills the image but for a margin.

        Args:
            seconds: time in the animation.
            azimuth, elevation: of the camera seen from the asset, degrees; azimuth 0 looks at its nose.
            width, height: of the image, pixels.
            lighting: linear light; directions in the body frame.
            samples: rays along each side of a pixel.
        """
        vertices = self._mesh.vertices_at(seconds).astype(np.float64)
        middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        self._caster.pose(0, vertices - middle, np.zeros(3))
        a, e = np.deg2rad([azimuth, elevation])
        centre = DISTANCE * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        pose = look_at(centre, np.zeros(3))
        seen = (vertices - middle - centre) @ pose[:3, :3]
        reach = np.abs(seen[:, :2] / seen[:, 2:]).max(axis=0)
        focal = 0.94 * float(np.min(np.array([width, height]) / 2 / reach))
        intrinsics = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
        camera = Pinhole(intrinsics, pose[:3, :3], centre, width, height)
        marks = self._caster.footprint(0, camera, (0, 0, width, height)).ravel()
        pixels = np.flatnonzero(marks)
        rays = np.where(marks[pixels] == CROSSED, samples, min(samples, INTERIOR_SAMPLES))
        hits = self._caster.cast(camera, pixels, rays, lighting=lighting, texture_samples=samples)
        linear, coverage = np.zeros((height * width, 3)), np.zeros(height * width)
        linear[pixels] = hits.colour
        coverage[pixels] = hits.visible[:, 0] / np.maximum(hits.rays, 1)
        return AssetImage(linear.reshape(height, width, 3), coverage.reshape(height, width))
