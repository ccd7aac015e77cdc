"""A planned scene: everything about a sequence that is decided before the first ray."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from aerojax.capture.format import CaptureCamera
from aerojax.simulate.assets.catalogue import Identity, build_identity
from aerojax.simulate.render.environment import Environment
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.surface import SurfaceConfig
from aerojax.simulate.world.flight import Flight
from aerojax.simulate.world.sensor import SensorConfig
from kernels.rays.landscape import LandscapeMesh

ASSET_LICENCE = "Apache-2.0"
"""Of the catalogue's own models."""


@dataclass(frozen=True)
class FlyingObject:
    """One object of a scene.

    identity: what flies. asset: its USD file.
    flight: poses in the world, `ScenePlan.margin` frames longer than the capture at both ends.
    phase: where in its cycle the asset's animation is at time 0, seconds.
    source, licence: of the model, for the truth.
    """

    identity: Identity
    asset: Path
    flight: Flight
    phase: float
    source: str = "aerojax"
    licence: str = ASSET_LICENCE


@dataclass(frozen=True)
class ScenePlan:
    """What `record_scene` renders and writes.

    objects: their mask values are 1, 2 … in this order.
    cameras: as they stand, with the patterns of the images to write and their clocks' offsets.
    calibration: the same cameras as the capture's user is told.
    environment: dome or landscape, and its light.
    images: what is rendered.
    frames, fps: length and rate.
    margin: frames by which flights are longer at either end: for the next pose of the last frame and for late clocks.
    sensors: one a camera; ideal ones if empty.
    noise_seed: of the sensors' noise.
    landscape: what the environment shows, for the scene's stage; None before a dome.
    surface: Gaussians that are written of every object.
    """

    objects: tuple[FlyingObject, ...]
    cameras: tuple[CaptureCamera, ...]
    calibration: tuple[CaptureCamera, ...]
    environment: Environment
    images: ImageConfig
    frames: int
    fps: float
    margin: int = 0
    sensors: tuple[SensorConfig, ...] = ()
    noise_seed: int = 0
    landscape: LandscapeMesh | None = None
    surface: SurfaceConfig = field(default_factory=SurfaceConfig)

    def shown(self, flight: Flight) -> Flight:
        """The part of a flight that the capture's frames show."""
        return flight.within(self.margin, self.frames)


def flying_object(identity: Identity, assets: Path, flight: Flight, phase: float) -> FlyingObject:
    """An object with its asset, which is built in the folder `assets` if it is not there."""
    asset = build_identity(identity, assets)
    if identity.model is None:
        return FlyingObject(identity, asset, flight, phase)
    model = identity.model
    return FlyingObject(identity, asset, flight, phase, model.source or model.file.name, model.licence or "unknown")


def image_patterns(camera: CaptureCamera, images: ImageConfig) -> CaptureCamera:
    """The camera with a pattern for each kind of image that is rendered."""
    name = camera.name
    return replace(
        camera,
        mask=f"{name}/mask/{{frame:06d}}.png",
        depth=f"{name}/depth/{{frame:06d}}.tiff" if images.depth else None,
        coverage=f"{name}/coverage/{{frame:06d}}.png" if images.coverage else None,
        normal=f"{name}/normal/{{frame:06d}}.png" if images.normals else None,
        flow=f"{name}/flow/{{frame:06d}}.tiff" if images.flow else None,
    )
