"""What surrounds the objects of a scene: the door of environments, and the dome of one colour."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, UInt8

from aerojax.capture.format import CaptureCamera
from kernels.rays.raytrace import Colour, Lighting, SceneCaster


@runtime_checkable
class Environment(Protocol):
    """What surrounds the objects."""

    def lighting(self, time: float) -> Lighting:
        """Light at a time in seconds since the sequence began."""
        ...

    def background(
        self, camera: CaptureCamera, time: float, caster: SceneCaster
    ) -> UInt8[np.ndarray, "height width 3"] | Float[np.ndarray, "3"]:
        """SRGB behind the objects of one camera: one colour, or an image with the objects' shadows."""
        ...

    def through_air(
        self, linear: Float[np.ndarray, "pixel 3"], depth: Float[np.ndarray, "pixel"], time: float
    ) -> Float[np.ndarray, "pixel 3"]:
        """Linear light of surfaces at a depth (metres) as it reaches a camera."""
        ...

    @property
    def static_mesh(self) -> object | None:
        """Warp mesh that hides and shades objects, world frame; None without one."""
        ...


@dataclass(frozen=True)
class Dome:
    """A sphere of one sRGB colour around everything, white by default, with its own light.

    by_camera: colours of single cameras, by name.
    """

    light: Lighting = field(default_factory=Lighting)
    colour: Colour = (1.0, 1.0, 1.0)
    by_camera: Mapping[str, Colour] = field(default_factory=dict)
    static_mesh: None = None

    def lighting(self, time: float) -> Lighting:
        """The same light at all times."""
        return self.light

    def background(self, camera: CaptureCamera, time: float, caster: SceneCaster) -> Float[np.ndarray, "3"]:
        """The camera's colour."""
        return self.behind(camera)

    def behind(self, camera: CaptureCamera) -> Float[np.ndarray, "3"]:
        """The camera's colour, sRGB, at all times."""
        return np.asarray(self.by_camera.get(camera.name, self.colour), np.float32)

    def through_air(
        self, linear: Float[np.ndarray, "pixel 3"], depth: Float[np.ndarray, "pixel"], time: float
    ) -> Float[np.ndarray, "pixel 3"]:
        """Clear air: what came in."""
        return linear
