"""One object a capture: every silhouette is of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import FrameSet, Silhouette, Track
from aerojax.geometry.cameras import pixel_rays
from aerojax.track.base import TrackerConfig
from aerojax.track.consensus import agreed


@dataclass(frozen=True)
class SingleConfig(TrackerConfig):
    """One object.

    pixel_noise: standard deviation of a box's centre, pixels; scales the position's covariance.
    """

    name: Literal["single"] = "single"
    pixel_noise: float = 1.0

    def build(self) -> SingleTracker:
        """The member."""
        return SingleTracker(self)


@dataclass(frozen=True, eq=False)
class SingleState:
    """The cameras, and where the object was last: metres, and seconds on the network's clock."""

    cameras: tuple[CaptureCamera, ...]
    position: Float64[np.ndarray, "3"] | None = None
    time_s: float = 0.0


@dataclass(frozen=True)
class SingleTracker:
    """Takes the silhouettes, of several in one camera the first, without parts that no other camera agrees with."""

    config: SingleConfig

    def initial(self, cameras: Sequence[CaptureCamera]) -> SingleState:
        """Nothing seen yet."""
        return SingleState(tuple(cameras))

    def step(
        self, frames: FrameSet, silhouettes: Sequence[Silhouette], state: SingleState
    ) -> tuple[list[Track], SingleState]:
        """Track 0, or nothing where no camera shows an object."""
        if not silhouettes:
            return [], state
        first = {one.camera: one for one in reversed(silhouettes)}
        by_camera = {one.camera: one for one in agreed(list(first.values()), state.cameras)}
        held = tuple(by_camera.get(index) for index in range(len(state.cameras)))
        found = triangulate(held, state.cameras, self.config.pixel_noise)
        if found is None:
            return [Track(0, held, None, None, None)], state
        position, covariance = found
        elapsed = frames.time_s - state.time_s
        velocity = (position - state.position) / elapsed if state.position is not None and elapsed > 0 else None
        return [Track(0, held, position, velocity, covariance)], SingleState(state.cameras, position, frames.time_s)


def triangulate(
    silhouettes: Sequence[Silhouette | None], cameras: Sequence[CaptureCamera], pixel_noise: float
) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]] | None:
    """Where the rays through the centres of whole silhouettes' boxes meet, with its covariance.

    Least squares of the distances to the rays, each weighed by what a pixel is worth at the object:
    X = (Σ Pᵢ/σᵢ²)⁻¹ Σ Pᵢoᵢ/σᵢ² with Pᵢ = I - dᵢdᵢᵀ and σᵢ = pixel noise · depth / focal length, whose inverse
    normal matrix is the covariance (Hartley & Sturm 1997; Förstner & Wrobel 2016, §4.2). Depths come from the
    unweighted solution.

    Returns:
        Position, metres, and covariance, square metres, in the frame of the cameras; None for fewer than two rays, or
        rays too parallel to say where they meet.
    """
    seen = [(one.box, cameras[one.camera]) for one in silhouettes if one is not None and one.whole]
    if len(seen) < 2:
        return None
    origins = np.stack([camera.world_from_cam[:3, 3] for _, camera in seen])
    directions = np.stack([_ray(box, camera) for box, camera in seen])
    projectors = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    anchor = origins.mean(axis=0)  # about the cameras' middle, so that no digits are lost far from the frame's zero
    from_anchor = np.einsum("rij,rj->ri", projectors, origins - anchor)
    first = projectors.sum(axis=0)
    if np.linalg.cond(first) > 1e12:
        return None
    position = np.linalg.solve(first, from_anchor.sum(axis=0)) + anchor
    depth = np.linalg.norm(position - origins, axis=1)
    focal = np.array([camera.K[0, 0] for _, camera in seen])
    weight = (focal / (pixel_noise * np.maximum(depth, 1e-6))) ** 2
    normal = np.einsum("r,rij->ij", weight, projectors)
    position = np.linalg.solve(normal, np.einsum("r,ri->i", weight, from_anchor)) + anchor
    return position, np.linalg.inv(normal)


def _ray(box: tuple[float, float, float, float], camera: CaptureCamera) -> Float64[np.ndarray, "3"]:
    return pixel_rays(np.array([(box[0] + box[2]) / 2, (box[1] + box[3]) / 2]), camera)
