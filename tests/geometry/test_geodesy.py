"""Places on the earth, compared with figures of WGS 84."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.geometry.geodesy import GeographicOrigin, geographic


@pytest.mark.parametrize("place", [(47.4, 8.5, 480.0), (-33.9, 151.2, 20.0), (90.0, 0.0, 5.0), (0.0, -179.0, 0.0)])
def test_the_origin_is_itself_and_up_is_height(place):
    origin = GeographicOrigin(*place)
    np.testing.assert_allclose(geographic(np.zeros(3), origin), place, atol=1e-9)
    np.testing.assert_allclose(geographic(np.array([0.0, 0.0, 50.0]), origin)[2], place[2] + 50, atol=1e-7)


def test_a_minute_of_latitude_and_longitude():
    """NIMA TR8350.2: radii of curvature at 45° are 6 367 381.8 m (meridian) and 6 388 838.3 m (prime vertical)."""
    origin = GeographicOrigin(45.0, 0.0, 0.0)
    north = 6_367_381.8 * np.radians(1 / 60)
    east = 6_388_838.3 * np.cos(np.radians(45)) * np.radians(1 / 60)
    latitude, longitude, _ = geographic(np.array([0.0, north, 0.0]), origin)
    assert abs(latitude - 45 - 1 / 60) < 1e-5 and longitude == 0
    latitude, longitude, height = geographic(np.array([[east, 0.0, 0.0]]), origin)[0]
    assert abs(longitude - 1 / 60) < 1e-7 and abs(latitude - 45) < 5e-6 and 0.1 < height < 0.2
