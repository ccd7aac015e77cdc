"""What a camera's sensor adds to an ideal picture: blur, exposure, white balance, noise; and its shutter.

Pure functions of images and of a NumPy generator. Blur and noise act on linear light, where sensors measure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float

from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from aerojax.core.errors import UserError
from kernels.rays.raytrace import Lighting

Image = Float[np.ndarray, "height width 3"]


@dataclass(frozen=True)
class SensorConfig:
    """A camera's imperfections; the defaults add nothing.

    exposure_stops: the picture is 2^stops as bright.
    white_balance: gains of red, green and blue.
    full_well: electrons of a saturated pixel; shot noise is the root of the electrons; 0 for none.
    read_noise: electrons, standard deviation.
    blur: standard deviation of the lens' Gaussian, pixels.
    shutter: share of the frame's period that the shutter is open: motion blur.
    shutter_steps: renderings that motion blur averages.
    row_time: rolling shutter: seconds from a row to the next; 0 reads all rows at once.
    row_bands: bands of rows that a rolling shutter is made of.
    """

    exposure_stops: float = 0.0
    white_balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    full_well: float = 0.0
    read_noise: float = 0.0
    blur: float = 0.0
    shutter: float = 0.0
    shutter_steps: int = 5
    row_time: float = 0.0
    row_bands: int = 12

    def __post_init__(self) -> None:
        if not 0.0 <= self.shutter <= 1.0:
            raise UserError(
                "invalid", f"sensor: shutter is {self.shutter}", "it is a share of the frame's period, 0 to 1"
            )
        if min(self.full_well, self.read_noise, self.blur, self.row_time) < 0 or min(self.white_balance) <= 0:
            raise UserError(
                "unreadable",
                "sensor: full_well, read_noise, blur and row_time must be 0 or more, gains above 0",
                "correct it",
            )
        if self.read_noise > 0 and self.full_well == 0:
            raise UserError(
                "invalid", "sensor: read_noise is in electrons and needs full_well", "set it, for instance to 10000"
            )
        if self.shutter_steps < 1 or self.row_bands < 1:
            raise UserError("invalid", "sensor: shutter_steps and row_bands count renderings", "use 1 or more")


def expose(rgb: Image, config: SensorConfig, *, rng: np.random.Generator) -> Image:
    """A picture as the sensor stores it: lens blur, exposure and white balance, shot and read noise, clipping.

    Args:
        rgb: sRGB, 0..1.
        config: what to add; an image is returned as it is where nothing is.
        rng: of the noise.
    """
    if _is_ideal(config):
        return rgb
    linear = gaussian_blur(linear_from_srgb(rgb), config.blur)
    gain = np.asarray(config.white_balance, np.float32) * np.float32(2.0**config.exposure_stops)
    return srgb_from_linear(sensor_noise(linear * gain, config.full_well, config.read_noise, rng=rng))


def _is_ideal(config: SensorConfig) -> bool:
    same = replace(config, shutter=0.0, shutter_steps=5, row_time=0.0, row_bands=12)
    return same == SensorConfig()


def gaussian_blur(linear: Image, sigma: float) -> Image:
    """Blur with a Gaussian of `sigma` pixels; the border is mirrored. The mean of a constant picture stays."""
    return cv2.GaussianBlur(linear, (0, 0), sigma, borderType=cv2.BORDER_REFLECT_101) if sigma > 0 else linear


def sensor_noise(linear: Image, full_well: float, read_noise: float, *, rng: np.random.Generator) -> Image:
    """Noise of photons and of reading: variance x/full_well + (read_noise/full_well)², clipped to 0..1.

    The Poisson count of electrons is drawn as a Gaussian of the same variance, which differs below about ten electrons.
    """
    clipped = np.clip(linear, 0.0, 1.0)
    if full_well <= 0:
        return clipped
    deviation = np.sqrt(clipped / full_well + (read_noise / full_well) ** 2, dtype=np.float32)
    return np.clip(clipped + deviation * rng.standard_normal(clipped.shape, dtype=np.float32), 0.0, 1.0)


def shutter_times(config: SensorConfig, fps: float, height: int) -> Float[np.ndarray, "band step"]:
    """Seconds, relative to the frame's time, of the renderings that one frame is made of.

    The exposure of the middle row is centred on the frame's time; a band of a rolling shutter has the time of its own
    middle row. A global shutter is one band.
    """
    steps = 1 if config.shutter == 0 else config.shutter_steps
    within = ((np.arange(steps) + 0.5) / steps - 0.5) * config.shutter / fps
    edges = _band_edges(config, height)
    return config.row_time * ((edges[:-1] + edges[1:]) / 2 - height / 2)[:, None] + within


def _band_edges(config: SensorConfig, height: int) -> np.ndarray:
    bands = 1 if config.row_time == 0 else min(config.row_bands, height)
    return np.linspace(0, height, bands + 1).round().astype(int)


def through_shutter(render: Callable[[float], Image], height: int, config: SensorConfig, fps: float) -> Image:
    """One frame through a shutter: motion blur averages renderings in linear light, rolling bands have own times.

    Args:
        render: sRGB picture of a moment in seconds relative to the frame's time; called once a band and step.
        height: rows of the picture.
        config: shutter and rows.
        fps: of the capture.
    """
    edges, parts = _band_edges(config, height), []
    for (first, last), moments in zip(pairwise(edges), shutter_times(config, fps, height), strict=True):
        parts.append(_averaged([render(float(moment))[first:last] for moment in moments]))
    return np.concatenate(parts)


def _averaged(pictures: Sequence[Image]) -> Image:
    if len(pictures) == 1:
        return pictures[0]
    return srgb_from_linear(np.mean([linear_from_srgb(p) for p in pictures], axis=0))


def draw_sensor(base: SensorConfig, strength: float, *, rng: np.random.Generator) -> SensorConfig:
    """A camera's own exposure, balance, noise and blur around `base`; strength 0 keeps it, 1 is a cheap camera.

    Raises:
        UserError: `strength` is not within 0 to 1.
    """
    _check_strength(strength)
    gains = np.exp(strength * 0.08 * rng.standard_normal(3))
    gains /= gains[1]
    noise = strength * rng.uniform(0.0, 1.0)
    well = 20000.0 / (1.0 + 6.0 * noise) if noise > 0 else base.full_well
    return replace(
        base,
        exposure_stops=base.exposure_stops + strength * float(rng.uniform(-0.6, 0.4)),
        white_balance=(float(gains[0]), 1.0, float(gains[2])),
        full_well=well,
        read_noise=max(base.read_noise, 12.0 * noise),
        blur=base.blur + strength * float(rng.uniform(0.0, 0.8)),
    )


def draw_lighting(base: Lighting, strength: float, *, rng: np.random.Generator) -> Lighting:
    """Light of another strength and tint from another direction; strength 0 keeps it."""
    _check_strength(strength)
    direction = np.asarray(base.sun_direction) / np.linalg.norm(base.sun_direction)
    direction = direction + strength * 0.5 * rng.standard_normal(3)
    direction[2] = max(direction[2], 0.1)
    factors = np.exp(strength * 0.3 * rng.standard_normal(3))
    warm = strength * float(rng.uniform(-0.12, 0.12))
    return replace(
        base,
        sun_direction=(float(direction[0]), float(direction[1]), float(direction[2])),
        sun=base.sun * float(factors[0]),
        sky=base.sky * float(factors[1]),
        ground=base.ground * float(factors[2]),
        sun_colour=(base.sun_colour[0] * (1 + warm), base.sun_colour[1], base.sun_colour[2] * (1 - warm)),
    )


def _check_strength(strength: float) -> None:
    if not 0.0 <= strength <= 1.0:
        raise UserError("invalid", f"randomisation strength is {strength}", "use 0 (none) to 1")
