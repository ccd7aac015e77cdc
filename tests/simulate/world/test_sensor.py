"""What a sensor adds: statistics of the noise, blur, exposure and the times of a shutter."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from aerojax.core.errors import UserError
from aerojax.simulate.world.sensor import (
    SensorConfig,
    draw_lighting,
    draw_sensor,
    expose,
    gaussian_blur,
    sensor_noise,
    shutter_times,
    through_shutter,
)
from kernels.rays.raytrace import Lighting


def flat(value: float, size: int = 160) -> np.ndarray:
    return np.full((size, size, 3), value, np.float32)


def test_noise_has_the_variance_of_photons_and_reading():
    noisy = sensor_noise(flat(0.4), 1000.0, 10.0, rng=np.random.default_rng(0))
    assert noisy.mean() == pytest.approx(0.4, abs=5e-4)
    assert noisy.var() == pytest.approx(0.4 / 1000.0 + 1e-4, rel=0.03)
    again = sensor_noise(flat(0.4), 1000.0, 10.0, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(noisy, again)


def test_an_ideal_sensor_changes_nothing():
    image = np.random.default_rng(0).uniform(size=(6, 7, 3)).astype(np.float32)
    assert expose(image, SensorConfig(shutter=0.5), rng=np.random.default_rng(0)) is image


def test_exposure_and_balance_are_gains_of_linear_light():
    config = SensorConfig(exposure_stops=-1.0, white_balance=(1.2, 1.0, 0.8))
    out = expose(srgb_from_linear(flat(0.3, 4)), config, rng=np.random.default_rng(0))
    assert linear_from_srgb(out)[0, 0] == pytest.approx([0.18, 0.15, 0.12], abs=1e-4)


def test_blur_has_the_width_that_it_says():
    point = np.zeros((41, 41, 3), np.float32)
    point[20, 20] = 1.0
    row = gaussian_blur(point, 2.0)[..., 0].sum(axis=0)
    away = np.arange(41) - 20
    assert row.sum() == pytest.approx(1.0, abs=1e-4)
    assert np.sqrt((row * away**2).sum()) == pytest.approx(2.0, abs=0.05)


def moving_bar(moment: float) -> np.ndarray:
    """A white column that moves 100 pixels a second from pixel 20."""
    image = np.zeros((30, 40, 3), np.float32)
    image[:, round(20 + 100.0 * moment)] = 1.0
    return image


def test_motion_blur_averages_light():
    config = SensorConfig(shutter=1.0, shutter_steps=5)
    linear = linear_from_srgb(through_shutter(moving_bar, 30, config, fps=20.0))
    assert linear[3, 18:23, 0] == pytest.approx(0.2, abs=1e-3)  # 5 pixels in 1/20 s
    assert linear[3].sum() == pytest.approx(3.0, abs=1e-2)


def test_rolling_rows_have_their_own_times():
    config = SensorConfig(row_time=1e-3, row_bands=30)
    times = shutter_times(config, 30.0, 30)
    assert times[:, 0] == pytest.approx((np.arange(30) + 0.5 - 15) * 1e-3)
    image = through_shutter(moving_bar, 30, config, fps=30.0)
    assert image[..., 0].argmax(axis=1).tolist() == [round(20 + 100.0 * t) for t in times[:, 0]]


def test_randomisation_is_seeded_and_scales():
    assert draw_sensor(SensorConfig(), 0.0, rng=np.random.default_rng(1)) == SensorConfig()
    one, two, other = (draw_sensor(SensorConfig(), 1.0, rng=np.random.default_rng(s)) for s in (1, 1, 2))
    assert one == two != other
    light = draw_lighting(Lighting(), 1.0, rng=np.random.default_rng(1))
    assert light != Lighting() and light.sun_direction[2] >= 0.1


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"shutter": 1.5}, "share of the frame"),
        ({"blur": -1.0}, "0 or more"),
        ({"read_noise": 3.0}, "needs full_well"),
        ({"shutter_steps": 0}, "1 or more"),
    ],
)
def test_mistakes_are_named(values, message):
    with pytest.raises(UserError, match=message):
        SensorConfig(**values)
    with pytest.raises(UserError, match=r"0 \(none\) to 1"):
        draw_sensor(SensorConfig(), 2.0, rng=np.random.default_rng(0))
