"""Places on the earth: a local frame of east, north and up (metres) about an origin, and WGS 84.

WGS 84: semi-major axis 6 378 137 m, flattening 1/298.257223563 (NIMA TR8350.2, 2000, table 3.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

_SEMI_MAJOR = 6_378_137.0
_FLATTENING = 1 / 298.257223563
_ECCENTRICITY_2 = _FLATTENING * (2 - _FLATTENING)


@dataclass(frozen=True)
class GeographicOrigin:
    """Where a world with axes +X east, +Y north, +Z up has its origin.

    latitude, longitude: degrees, WGS 84, north and east positive.
    height: metres above the ellipsoid.
    """

    latitude: float
    longitude: float
    height: float


def geographic(points: Float64[np.ndarray, "*batch 3"], origin: GeographicOrigin) -> Float64[np.ndarray, "*batch 3"]:
    """Latitude and longitude (degrees) and height above the ellipsoid (metres) of points of the world, metres.

    East, north and up are turned to the earth-centred frame at the origin; latitude comes from Bowring's iteration
    (Bowring 1976), which three rounds bring below a nanometre near the ground.
    """
    latitude, longitude = np.radians(origin.latitude), np.radians(origin.longitude)
    x, y, z = np.moveaxis(points @ _east_north_up(latitude, longitude) + _earth_centred(origin), -1, 0)
    distance = np.hypot(x, y)
    semi_minor = _SEMI_MAJOR * (1 - _FLATTENING)
    reduced = np.arctan2(z * _SEMI_MAJOR, distance * semi_minor)
    for _ in range(3):
        found = np.arctan2(
            z + _ECCENTRICITY_2 / (1 - _ECCENTRICITY_2) * semi_minor * np.sin(reduced) ** 3,
            distance - _ECCENTRICITY_2 * _SEMI_MAJOR * np.cos(reduced) ** 3,
        )
        reduced = np.arctan2((1 - _FLATTENING) * np.sin(found), np.cos(found))
    # Along the normal, which is well scaled at the poles too.
    height = distance * np.cos(found) + z * np.sin(found) - _SEMI_MAJOR**2 / _normal_radius(found)
    return np.stack([np.degrees(found), np.degrees(np.arctan2(y, x)), height], axis=-1)


def _east_north_up(latitude: np.float64, longitude: np.float64) -> Float64[np.ndarray, "3 3"]:
    """Unit vectors east, north and up in the earth-centred frame, one a row."""
    sin_b, cos_b, sin_l, cos_l = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    return np.array(
        [
            [-sin_l, cos_l, 0.0],
            [-sin_b * cos_l, -sin_b * sin_l, cos_b],
            [cos_b * cos_l, cos_b * sin_l, sin_b],
        ]
    )


def _normal_radius(latitude: Float64[np.ndarray, "*batch"] | np.float64) -> Float64[np.ndarray, "*batch"] | np.float64:
    """Radius of curvature in the prime vertical, metres."""
    return _SEMI_MAJOR / np.sqrt(1 - _ECCENTRICITY_2 * np.sin(latitude) ** 2)


def _earth_centred(origin: GeographicOrigin) -> Float64[np.ndarray, "3"]:
    latitude, longitude = np.radians(origin.latitude), np.radians(origin.longitude)
    radius = _normal_radius(latitude)
    flat = (radius + origin.height) * np.cos(latitude)
    up = ((1 - _ECCENTRICITY_2) * radius + origin.height) * np.sin(latitude)
    return np.array([flat * np.cos(longitude), flat * np.sin(longitude), up], dtype=np.float64)
