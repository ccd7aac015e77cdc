"""Daylight: the sky of Preetham, Shirley and Smits (SIGGRAPH 1999), sunlight through clear air, clouds and haze.

Luminances are in kcd/m², illuminances in klux; an exposure brings them to the linear 0..1 of images.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.geometry.directions import golden_spiral
from kernels.rays.raytrace import Lighting

# Perez coefficients A..E of luminance Y and chromaticities x, y: slope in turbidity and offset (Preetham 1999, A.2).
_PEREZ = {
    "Y": ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)),
    "x": ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)),
    "y": ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)),
}
# Zenith chromaticity: rows of turbidity², turbidity, 1; columns of the sun's zenith angle cubed to its power 0 (A.2).
_ZENITH_X = (
    (0.00166, -0.00375, 0.00209, 0.0),
    (-0.02903, 0.06377, -0.03202, 0.00394),
    (0.11693, -0.21196, 0.06052, 0.25886),
)
_ZENITH_Y = (
    (0.00275, -0.00610, 0.00317, 0.0),
    (-0.04214, 0.08970, -0.04153, 0.00516),
    (0.15346, -0.26756, 0.06670, 0.26688),
)
_RGB_FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
_WAVELENGTHS = np.array([0.61, 0.55, 0.465])
"""Micrometres of the red, green and blue primaries, about the dominant wavelengths of sRGB."""
_SOLAR_ILLUMINANCE = 128.0
"""Klux above the atmosphere."""
_SUN_RADIUS = np.deg2rad(0.266)


@dataclass(frozen=True)
class SkyConfig:
    """One day's sky.

    turbidity: 2 (very clear) to 6 (hazy).
    sun_azimuth, sun_elevation: degrees at time 0; azimuth from +X towards +Y.
    sun_azimuth_rate, sun_elevation_rate: degrees a second of sequence time (the real sun: 0.004).
    cloud_cover: share of the sky that clouds hide, 0..1; they also take that share of the sun's strength.
    visibility: metres at which contrast has fallen to 2 % (Koschmieder: extinction = 3.912 / visibility).
    exposure: 1 shows a white board in full light at 1.2 times white, as a camera set for grass does.
    ground_albedo: linear reflectance of the land, for the light that comes from below.
    """

    turbidity: float = 3.0
    sun_azimuth: float = 140.0
    sun_elevation: float = 40.0
    sun_azimuth_rate: float = 0.004
    sun_elevation_rate: float = 0.0
    cloud_cover: float = 0.3
    visibility: float = 12000.0
    exposure: float = 1.0
    ground_albedo: tuple[float, float, float] = (0.12, 0.14, 0.06)


def sun_direction(config: SkyConfig, time: float) -> Float[np.ndarray, "3"]:
    """Unit vector to the sun, world frame, at a time in seconds; it stays at least 2 degrees high."""
    azimuth = np.deg2rad(config.sun_azimuth + config.sun_azimuth_rate * time)
    elevation = np.deg2rad(np.clip(config.sun_elevation + config.sun_elevation_rate * time, 2.0, 88.0))
    flat = np.cos(elevation)
    return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def sky_luminance(
    directions: Float[np.ndarray, "*shape 3"], to_sun: Float[np.ndarray, "3"], turbidity: float
) -> Float[np.ndarray, "*shape 3"]:
    """Linear sRGB luminance of the clear sky (kcd/m²) in unit directions; below the horizon that of the horizon.

    The fitted chromaticities turn magenta within a few degrees of the horizon: there those of 8 degrees are kept.
    """
    height = np.clip(directions[..., 2], 0.02, 1.0)
    cosines = {"Y": height, "x": np.maximum(height, 0.14), "y": np.maximum(height, 0.14)}
    zenith = float(np.arccos(np.clip(to_sun[2], 0.0, 1.0)))
    gamma = np.arccos(np.clip(directions @ to_sun, -1.0, 1.0))
    powers = np.array([zenith**3, zenith**2, zenith, 1.0])
    mixing = np.array([turbidity**2, turbidity, 1.0])
    chi = (4.0 / 9.0 - turbidity / 120.0) * (np.pi - 2.0 * zenith)
    zenith_y = (4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192
    at_zenith = {"Y": zenith_y, "x": mixing @ np.array(_ZENITH_X) @ powers, "y": mixing @ np.array(_ZENITH_Y) @ powers}
    value = {
        k: v * _perez(k, cosines[k], gamma, turbidity) / _perez(k, 1.0, zenith, turbidity) for k, v in at_zenith.items()
    }
    scale = value["Y"] / value["y"]
    xyz = np.stack([value["x"] * scale, value["Y"], (1.0 - value["x"] - value["y"]) * scale], axis=-1)
    return np.maximum(xyz @ _RGB_FROM_XYZ.T, 0.0)


def _perez(kind: str, cosine: np.ndarray | float, gamma: np.ndarray | float, turbidity: float) -> np.ndarray | float:
    a, b, c, d, e = (slope * turbidity + offset for slope, offset in _PEREZ[kind])
    return (1.0 + a * np.exp(b / cosine)) * (1.0 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2)


def sun_illuminance(to_sun: Float[np.ndarray, "3"], turbidity: float) -> Float[np.ndarray, "3"]:
    """Klux at normal incidence through Rayleigh and aerosol scattering (Preetham 1999, A.1), linear RGB."""
    zenith = np.rad2deg(np.arccos(to_sun[2]))
    mass = 1.0 / (to_sun[2] + 0.15 * (93.885 - zenith) ** -1.253)
    rayleigh = np.exp(-0.008735 * mass * _WAVELENGTHS**-4.08)
    aerosol = np.exp(-(0.04608 * turbidity - 0.04586) * mass * _WAVELENGTHS**-1.3)
    return _SOLAR_ILLUMINANCE * rayleigh * aerosol


def sky_illuminance(to_sun: Float[np.ndarray, "3"], turbidity: float) -> Float[np.ndarray, "3"]:
    """Klux on level ground from the clear sky, linear RGB: the integral of luminance times cosine."""
    count = 600  # points of a Fibonacci hemisphere: a hundredth of the result
    height = (np.arange(count) + 0.5) / count
    directions = golden_spiral(height)
    return 2.0 * np.pi * (sky_luminance(directions, to_sun, turbidity) * height[:, None]).mean(axis=0)


@dataclass(frozen=True)
class Daylight:
    """Light at one moment: `lighting` of surfaces, `airlight` of thick haze, and image value per kcd/m²."""

    lighting: Lighting
    airlight: Float[np.ndarray, "3"]
    per_luminance: float


def daylight(config: SkyConfig, time: float) -> Daylight:
    """Light of the sky at a time in seconds; clouds weaken the sun and whiten the sky."""
    to_sun = sun_direction(config, time)
    sun = sun_illuminance(to_sun, config.turbidity) * (1.0 - 0.85 * config.cloud_cover)
    clear = sky_illuminance(to_sun, config.turbidity)
    sky = (1.0 - config.cloud_cover) * clear + config.cloud_cover * (1.4 * clear.mean())
    level = sun * to_sun[2] + sky
    per_luminance = config.exposure * 1.2 * np.pi / float(level.mean())
    scale = per_luminance / np.pi
    ground = np.asarray(config.ground_albedo) * level
    ring = np.stack([np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4), np.full(8, 0.03)], axis=1)
    airlight = sky_luminance(ring, to_sun, config.turbidity).mean(axis=0) * per_luminance
    direction = (float(to_sun[0]), float(to_sun[1]), float(to_sun[2]))
    lighting = Lighting(
        direction, 1.0, 1.0, 1.0, _tint(sun * scale), _tint(sky * scale), _tint(ground * scale), shadows=True
    )
    return Daylight(lighting, np.minimum(airlight, 1.0), per_luminance)


def _tint(colour: np.ndarray) -> tuple[float, float, float]:
    return (float(colour[0]), float(colour[1]), float(colour[2]))


def cloud_noise(seed: int, size: int = 512) -> Float[np.ndarray, "size size"]:
    """Periodic noise with power falling as frequency^-3.4, ranks spread evenly over 0..1."""
    rng = np.random.default_rng(seed)
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    frequency[0, 0] = np.inf
    spectrum = np.fft.fft2(rng.standard_normal((size, size))) * frequency**-1.7
    value = np.fft.ifft2(spectrum).real
    rank = np.empty(value.size)
    rank[np.argsort(value, axis=None, kind="stable")] = np.linspace(0.0, 1.0, value.size)
    return rank.reshape(size, size).astype(np.float32)


def sun_disc(directions: Float[np.ndarray, "*shape 3"], to_sun: Float[np.ndarray, "3"]) -> Float[np.ndarray, "*shape"]:
    """1 on the sun's disc, fading over a tenth of its radius, 0 elsewhere."""
    away = np.linalg.norm(directions - to_sun, axis=-1)  # the chord is the angle for angles this small
    return np.clip((1.1 * _SUN_RADIUS - away) / (0.1 * _SUN_RADIUS), 0.0, 1.0)
