"""What surrounds a sequence: a white dome, sky colours, or a landscape on a day of its own."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from aerojax.capture.format import CaptureCamera
from aerojax.core.seeds import number_of
from aerojax.simulate.plan.dataset import DatasetConfig, RigConfig, SequenceTask
from aerojax.simulate.render.environment import Dome, Environment
from aerojax.simulate.render.outdoors import Outdoors
from aerojax.simulate.world.landscape import LandscapeConfig, build_landscape
from aerojax.simulate.world.sensor import draw_lighting
from aerojax.simulate.world.sky import SkyConfig
from kernels.rays.landscape import LandscapeCaster, LandscapeMesh
from kernels.rays.raytrace import Colour, Lighting


def draw_environment(
    task: SequenceTask, config: DatasetConfig, cameras: tuple[CaptureCamera, ...], rng: np.random.Generator
) -> tuple[Environment, LandscapeMesh | None]:
    """What surrounds a sequence, and the landscape in it; None before a dome.

    Args:
        task: its name decides the landscape.
        config: of the data set.
        cameras: at each of them the landscape is kept clear; each has a sky colour of its own before a dome.
        rng: of light, sky and weather.
    """
    if config.rig.environment == "outdoor":
        return _outdoors(task, config, cameras, rng)
    light = draw_dome_light(rng)
    if config.randomisation > 0:
        light = draw_lighting(light, config.randomisation, rng=rng)
    if config.rig.environment == "white":
        return Dome(light=light), None
    by_camera = dict(zip((c.name for c in cameras), draw_sky_colours(len(cameras), rng), strict=True))
    return Dome(light=light, by_camera=by_camera), None


def _outdoors(
    task: SequenceTask, config: DatasetConfig, cameras: tuple[CaptureCamera, ...], rng: np.random.Generator
) -> tuple[Environment, LandscapeMesh | None]:
    """The site's landscape and a day of its own for every sequence."""
    sky = draw_sky(config.rig, rng)
    clear = tuple((float(c.world_from_cam[0, 3]), float(c.world_from_cam[1, 3])) for c in cameras)
    seed = number_of(config.seed, f"{site_of(task, config)}/landscape") % 2**31
    landscape, caster = _site(config.rig.landscape, clear, seed)
    return Outdoors(landscape, sky, caster=caster), landscape


def draw_sky(rig: RigConfig, rng: np.random.Generator) -> SkyConfig:
    """A day: clear to hazy, cloudy or not, low to high sun that moves, rises and sinks as the rig says."""
    return SkyConfig(
        turbidity=rng.uniform(2.0, 5.0),
        sun_azimuth=rng.uniform(0.0, 360.0),
        sun_elevation=rng.uniform(15.0, 65.0),
        sun_azimuth_rate=rig.sun_rate,
        cloud_cover=rng.uniform(0.0, 0.7),
        visibility=10 ** rng.uniform(3.6, 4.5),
        exposure=rng.uniform(0.8, 1.2),
        sun_elevation_rate=rng.uniform(-1.0, 1.0) * rig.sun_climb,  # the last draw: the others stay as they were
    )


def site_of(task: SequenceTask, config: DatasetConfig) -> str:
    """Which landscape a sequence is flown over: one of the rig's sites, or its own."""
    sites = config.rig.sites
    return f"site_{number_of(config.seed, task.name) % sites:03d}" if sites else task.name


@lru_cache(maxsize=1)
def _site(
    config: LandscapeConfig, clear: tuple[tuple[float, float], ...], seed: int
) -> tuple[LandscapeMesh, LandscapeCaster]:
    """A landscape and its caster, kept for the next sequence at the same site."""
    landscape = build_landscape(config, np.array(clear), seed=seed)
    return landscape, LandscapeCaster(landscape)


def draw_dome_light(rng: np.random.Generator) -> Lighting:
    """Sun and sky before a dome, in every direction and of every strength that a fair day has."""
    azimuth, elevation = rng.uniform(0, 2 * np.pi), np.deg2rad(rng.uniform(20, 80))
    flat = np.cos(elevation)
    sun = (float(flat * np.cos(azimuth)), float(flat * np.sin(azimuth)), float(np.sin(elevation)))
    return Lighting(sun, sun=rng.uniform(0.2, 0.7), sky=rng.uniform(0.35, 0.7), ground=rng.uniform(0.1, 0.4))


def draw_sky_colours(cameras: int, rng: np.random.Generator) -> tuple[Colour, ...]:
    """One sky colour a camera, sRGB."""
    skies = rng.uniform([0.45, 0.55, 0.65], [0.85, 0.9, 1.0], (cameras, 3))
    return tuple((s[0], s[1], s[2]) for s in skies.tolist())
