"""What the renderer gives: an image as the window that objects touch and what is behind it, and each object's truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8, UInt16

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import Box
from kernels.rays.raytrace import Pinhole

Window = tuple[int, int, int, int]
NO_WINDOW: Window = (0, 0, 0, 0)


MOST_SAMPLES = 12
"""Rays along a side of a pixel, at most."""
INTERIOR_SAMPLES = 2
"""Rays along a side of a pixel that no silhouette crosses: four smooth texture and colour borders."""


@dataclass(frozen=True)
class ImageConfig:
    """What is rendered.

    samples: least rays along each side of a pixel at silhouettes.
    rays_across: so many along an object's longer side in the image, up to `MOST_SAMPLES` a pixel's side: what is small
        costs little, and a pixel is much of it.
    depth, normals, flow, coverage: which of these a `RenderedImage` holds (flow needs the next poses too).
    mask_threshold: least visible coverage of a mask pixel; below one half, because a rotor blade or wing tip seldom
        fills half a pixel.
    """

    samples: int = 3
    rays_across: int = 384
    depth: bool = True
    normals: bool = False
    flow: bool = False
    coverage: bool = True
    mask_threshold: float = 0.25


@dataclass(frozen=True)
class ObjectView:
    """One object in one image.

    object_id: its value in the mask.
    box: tight around its mask, x0 y0 x1 y1, ends exclusive; None where the mask has none of it.
    visible_box: around its visible samples, so to a fraction of a pixel; None where none shows it.
    projected_box: of all its posed vertices, pixels, not clipped; None where any is behind the camera.
    visibility: visible coverage over its coverage if it were alone, both inside the image, 0..1.
    truncated: part of it lies outside the image (or behind the camera).
    surface_centroid: mean of its visible surface points by coverage, metres, world; None where none is visible.
    """

    object_id: int
    box: Box | None
    visible_box: Box | None
    projected_box: Box | None
    visibility: float
    truncated: bool
    surface_centroid: tuple[float, float, float] | None


@dataclass(frozen=True)
class RenderedImage:
    """One image: the window that objects touch, and the background.

    width, height: of the image.
    window: x0 y0 x1 y1, ends exclusive; empty where no object is in the image. All arrays below are of the window.
    background: sRGB of the rest, one colour (0..1) or a whole image of bytes.
    rgb: sRGB, 0..1.
    mask: the id with most coverage where the visible coverage of all objects reaches the threshold, else 0.
    coverage: visible share of the pixel, all objects.
    depth: z of the object at the pixel's centre, or where only part of a mask pixel is covered the mean of the covered
        samples; metres, 0 where there is none.
    normal: world frame, unit, towards the camera; 0 where there is none.
    flow: pixels that the surface moves to the next frame, u right, v down; 0 where there is none.
    objects: one an object, in the order of the renderer.
    rays: rays cast for the window.
    """

    width: int
    height: int
    window: Window
    background: UInt8[np.ndarray, "height width 3"] | Float[np.ndarray, "3"]
    rgb: Float[np.ndarray, "rows columns 3"]
    mask: UInt16[np.ndarray, "rows columns"]
    coverage: Float[np.ndarray, "rows columns"] | None
    depth: Float[np.ndarray, "rows columns"] | None
    normal: Float[np.ndarray, "rows columns 3"] | None
    flow: Float[np.ndarray, "rows columns 2"] | None
    objects: tuple[ObjectView, ...]
    rays: int

    def full(self, name: str) -> np.ndarray:
        """A whole-image array of `mask`, `coverage`, `depth`, `normal` or `flow`, zero outside the window."""
        part = getattr(self, name)
        whole = np.zeros((self.height, self.width, *part.shape[2:]), part.dtype)
        x0, y0, x1, y1 = self.window
        whole[y0:y1, x0:x1] = part
        return whole

    def full_rgb8(self) -> UInt8[np.ndarray, "_ _ 3"]:
        """The whole image as sRGB bytes."""
        if self.background.ndim == 1:
            whole = np.empty((self.height, self.width, 3), np.uint8)
            whole[:] = np.round(self.background * 255.0).astype(np.uint8)
        else:
            whole = self.background.copy()
        x0, y0, x1, y1 = self.window
        whole[y0:y1, x0:x1] = np.round(self.rgb * 255.0).astype(np.uint8)
        return whole

    def full_rgb(self) -> Float[np.ndarray, "_ _ 3"]:
        """The whole image, sRGB 0..1 in float32; outdoors the background has 8 bits."""
        whole = np.empty((self.height, self.width, 3), np.float32)
        whole[:] = self.background if self.background.ndim == 1 else self.background / np.float32(255.0)
        x0, y0, x1, y1 = self.window
        whole[y0:y1, x0:x1] = self.rgb
        return whole


def pinhole(camera: CaptureCamera) -> Pinhole:
    """The rays' view of a camera."""
    pose = camera.world_from_cam
    return Pinhole(camera.K, pose[:3, :3], pose[:3, 3], camera.width, camera.height)
