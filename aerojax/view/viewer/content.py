"""What the viewer draws, before it is text in a page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64


class Lens(NamedTuple):
    """A pinhole camera's image in pixels; the centre of the top-left pixel is (0.5, 0.5)."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int


@dataclass(frozen=True, eq=False)
class Splats:
    """Gaussians in world axes about a centre of their own, so that 32-bit floats hold them anywhere on Earth.

    mean: metres from the centre. quaternion: w, x, y, z. scale: standard deviations, metres. opacity: 0..1.
    rgb: sRGB, 0..1.
    """

    mean: Float32[np.ndarray, "gaussian 3"]
    quaternion: Float32[np.ndarray, "gaussian 4"]
    scale: Float32[np.ndarray, "gaussian 3"]
    opacity: Float32[np.ndarray, "gaussian"]
    rgb: Float32[np.ndarray, "gaussian 3"]


@dataclass(frozen=True, eq=False)
class SceneCamera:
    """A camera of the rig.

    world_from_cam: rigid transform, metres, OpenCV axes. suspect: whether it disagrees with the others.
    """

    name: str
    lens: Lens
    world_from_cam: Float64[np.ndarray, "4 4"]
    suspect: bool = False
