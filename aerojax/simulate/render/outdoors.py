"""The outdoor environment: a landscape under a daylight sky, cast once a camera and lit as the sun moves."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from aerojax.capture.format import CaptureCamera
from aerojax.geometry.cameras import pixels_of_camera_points
from aerojax.simulate.render.image import pinhole
from aerojax.simulate.world.sky import Daylight, SkyConfig, cloud_noise, daylight, sky_luminance, sun_disc
from kernels.rays.landscape import LandscapeCaster, LandscapeMesh, SurfaceBuffer
from kernels.rays.raytrace import Lighting, Pinhole, SceneCaster

_SKY_STEP = 8
"""Pixels between the points where the clear sky, which is smooth, is evaluated."""

_CLOUD_SCALE = 0.12
"""Repetitions of the cloud noise in one cloud height: the largest clouds are a few cloud heights wide."""


@dataclass(frozen=True)
class OutdoorConfig:
    """How the landscape is rendered.

    edge_samples: rays along each side of a pixel at edges of the landscape.
    sun_step: degrees that the sun moves between two lightings of the landscape.
    shadow_step: degrees that it moves before the landscape's own shadows are cast again.
    """

    edge_samples: int = 2
    sun_step: float = 0.05
    shadow_step: float = 1.0


@dataclass
class _CameraState:
    """What is kept of a camera; `image` was lit at `moment` and its shadows cast at `shadow_moment` (sequence time)."""

    buffer: SurfaceBuffer
    clouds: np.ndarray
    image: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 3), np.uint8))
    sky: Any = None
    moment: float | None = None
    shadow_moment: float | None = None


class Outdoors:
    """Landscape, sky and sun around the objects (an `Environment`).

    The buffers of every camera that was rendered are kept: about 120 MB for 2560×1440 pixels. A picture depends on the
    time alone, not on what was rendered before.

    Args:
        landscape: from `world.landscape.build_landscape`.
        sky: the day.
        config: quality.
        caster: of the same landscape, where one exists; what it has cast for a camera is not cast again.
    """

    def __init__(
        self,
        landscape: LandscapeMesh,
        sky: SkyConfig,
        config: OutdoorConfig | None = None,
        *,
        caster: LandscapeCaster | None = None,
    ):
        self._sky, self._config = sky, config or OutdoorConfig()
        self._caster = caster or LandscapeCaster(landscape)
        self._lowest = float(landscape.vertices[:, 2].min())
        self._noise = cloud_noise(landscape.seed)
        self._cameras: dict[str, _CameraState] = {}
        self._light: tuple[float, Daylight] | None = None

    @property
    def static_mesh(self) -> object | None:
        """The landscape's Warp mesh, world frame."""
        return self._caster.mesh

    @property
    def rays(self) -> int:
        """Rays cast for the landscape so far."""
        return sum(state.buffer.rays for state in self._cameras.values())

    def lighting(self, time: float) -> Lighting:
        """Light at a time in seconds since the sequence began."""
        return self._daylight(self._moment(time, self._config.sun_step)).lighting

    def through_air(
        self, linear: Float[np.ndarray, "pixel 3"], depth: Float[np.ndarray, "pixel"], time: float
    ) -> Float[np.ndarray, "pixel 3"]:
        """Linear light of surfaces at a depth (metres) after haze has dimmed it and added its own."""
        extinction, airlight = self._haze(self._daylight(self._moment(time, self._config.sun_step)))
        clear = np.exp(-extinction * depth.astype(np.float64))[:, None]
        return (clear * linear + (1.0 - clear) * airlight).astype(np.float32)

    def background(
        self, camera: CaptureCamera, time: float, caster: SceneCaster
    ) -> UInt8[np.ndarray, "height width 3"]:
        """The landscape as sRGB bytes, with the shadows of the posed objects."""
        view = pinhole(camera)
        state = self._cameras.get(camera.name)
        if state is None or not _same(state.buffer.camera, view):
            buffer = self._caster.buffer(view, self._config.edge_samples)
            state = self._cameras[camera.name] = _CameraState(buffer, self._clouds(view))
        self._relight(state, time)
        image = state.image.copy()
        for window in self._shadow_windows(view, time, caster):
            self._lit(state, image, window, caster)
        return image

    def _relight(self, state: _CameraState, time: float) -> None:
        moment = self._moment(time, self._config.sun_step)
        if state.moment == moment:
            return
        shadows = self._moment(time, self._config.shadow_step)
        if state.shadow_moment != shadows:
            self._caster.cast_sun(state.buffer, np.asarray(self._daylight(shadows).lighting.sun_direction))
            state.shadow_moment = shadows
        view = state.buffer.camera
        state.moment = moment
        state.sky = self._caster.upload(self._sky_image(view, state.clouds, moment))
        state.image = np.zeros((view.height, view.width, 3), np.uint8)
        self._lit(state, state.image, (0, 0, view.width, view.height), None)

    def _lit(
        self, state: _CameraState, image: np.ndarray, window: tuple[int, int, int, int], caster: SceneCaster | None
    ) -> None:
        light = self._daylight(state.moment or 0.0)
        self._caster.light(
            state.buffer, image, window, sky=state.sky, lighting=light.lighting, haze=self._haze(light), objects=caster
        )

    def _moment(self, time: float, step: float) -> float:
        """The last time at or before `time` when the sun had moved by a multiple of `step` degrees."""
        rate = float(np.hypot(self._sky.sun_azimuth_rate, self._sky.sun_elevation_rate))
        return float(np.floor(time * rate / step + 1e-9) * step / rate) if rate > 0 else 0.0

    def _daylight(self, moment: float) -> Daylight:
        if self._light is None or self._light[0] != moment:
            self._light = (moment, daylight(self._sky, moment))
        return self._light[1]

    def _haze(self, light: Daylight) -> tuple[float, np.ndarray]:
        return 3.912 / self._sky.visibility, light.airlight

    def _clouds(self, view: Pinhole) -> Float[np.ndarray, "height width"]:
        """Opacity of the clouds: noise on a level sheet, thinned to the cover and dissolving at the horizon."""
        directions = _directions(view, 2)
        up = np.maximum(directions[..., 2], 0.02)
        x, y = (512.0 * _CLOUD_SCALE * directions[..., i] / up for i in (0, 1))
        noise = cv2.remap(self._noise, x % 512.0, y % 512.0, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        opacity = np.clip((noise - (1.0 - self._sky.cloud_cover)) / 0.35, 0.0, 1.0)
        opacity *= 0.9 * np.clip((directions[..., 2] - 0.02) / 0.2, 0.0, 1.0)
        return cv2.resize(opacity.astype(np.float32), (view.width, view.height), interpolation=cv2.INTER_CUBIC)

    def _sky_image(self, view: Pinhole, clouds: np.ndarray, moment: float) -> Float[np.ndarray, "height width 3"]:
        """Linear light of clear sky, sun and clouds."""
        light = self._daylight(moment)
        to_sun = np.asarray(light.lighting.sun_direction)
        coarse = sky_luminance(_directions(view, _SKY_STEP).astype(np.float64), to_sun, self._sky.turbidity)
        coarse = np.minimum(coarse * light.per_luminance, 4.0).astype(np.float32)
        image = cv2.resize(coarse, (view.width, view.height), interpolation=cv2.INTER_LINEAR)
        self._add_sun(image, view, to_sun)
        sunlit = np.asarray(light.lighting.sun_colour) * 0.55 + np.asarray(light.lighting.sky_colour) * 0.6
        white = (sunlit + 0.25).astype(np.float32)
        image += clouds[..., None] * (white - image)
        return image

    def _add_sun(self, image: np.ndarray, view: Pinhole, to_sun: np.ndarray) -> None:
        local = view.rotation.T @ to_sun
        if local[2] <= 0:
            return
        at = pixels_of_camera_points(local, view)
        reach = 0.006 * view.K[0, 0] / local[2] ** 2 + 2.0
        x0, x1 = (int(np.clip(v, 0, view.width)) for v in (at[0] - reach, at[0] + reach + 1))
        y0, y1 = (int(np.clip(v, 0, view.height)) for v in (at[1] - reach, at[1] + reach + 1))
        if x1 > x0 and y1 > y0:
            disc = sun_disc(_directions(view, 1, (x0, y0, x1, y1)).astype(np.float64), to_sun)
            image[y0:y1, x0:x1] += (8.0 * disc[..., None]).astype(np.float32)

    def _shadow_windows(self, view: Pinhole, time: float, caster: SceneCaster) -> list[tuple[int, int, int, int]]:
        """Pixels where the shadow of each object's bounding sphere can fall."""
        to_sun = np.asarray(self.lighting(time).sun_direction)
        found = []
        _, relative, radii = caster.shadow_casters(view)
        for centre, radius in zip(view.centre - relative, radii, strict=True):
            reach = (centre[2] + radius - self._lowest) / to_sun[2]
            window = _swept_window(view, centre, float(radius), -to_sun * max(reach, 0.0))
            if window is not None:
                found.append(window)
        return found


def _same(one: Pinhole, other: Pinhole) -> bool:
    sizes = (one.width, one.height) == (other.width, other.height)
    arrays = zip((one.K, one.rotation, one.centre), (other.K, other.rotation, other.centre), strict=True)
    return sizes and all(np.array_equal(a, b) for a, b in arrays)


def _directions(
    view: Pinhole, step: int, window: tuple[int, int, int, int] | None = None
) -> Float[np.ndarray, "rows columns 3"]:
    """Unit world directions of points every `step` pixels, as `cv2.resize` places its samples."""
    x0, y0, x1, y1 = window or (0, 0, view.width, view.height)
    columns, rows = -(-(x1 - x0) // step), -(-(y1 - y0) // step)
    u = x0 + (np.arange(columns) + 0.5) * (x1 - x0) / columns
    v = y0 + (np.arange(rows) + 0.5) * (y1 - y0) / rows
    local = np.ones((rows, columns, 3))
    local[..., 0] = (u - view.K[0, 2]) / view.K[0, 0]
    local[..., 1] = ((v - view.K[1, 2]) / view.K[1, 1])[:, None]
    world = local @ view.rotation.T
    return (world / np.linalg.norm(world, axis=-1, keepdims=True)).astype(np.float32)


def _swept_window(
    view: Pinhole, centre: np.ndarray, radius: float, sweep: np.ndarray
) -> tuple[int, int, int, int] | None:
    """Pixels of a cube of half side `radius` swept along a vector, in front of the camera; None outside the image."""
    signs = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
    start = (centre + radius * signs - view.centre) @ view.rotation
    end = start + sweep @ view.rotation
    near, points = 0.05, []
    for a, b in zip(start, end, strict=True):
        if a[2] < near and b[2] < near:
            continue
        for p, q in ((a, b), (b, a)):
            points.append(p if p[2] >= near else p + (q - p) * (near - p[2]) / (q[2] - p[2]))
    if not points:
        return None
    local = np.array(points)
    pixels = pixels_of_camera_points(local, view)
    x0, y0 = np.clip(np.floor(pixels.min(axis=0)), 0, (view.width, view.height)).astype(int)
    x1, y1 = np.clip(np.ceil(pixels.max(axis=0)), 0, (view.width, view.height)).astype(int)
    return (int(x0), int(y0), int(x1), int(y1)) if x1 > x0 and y1 > y0 else None
