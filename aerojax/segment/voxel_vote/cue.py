"""Motion cue of one camera: how sure each pixel is that something moves there (thesis C.2)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float32

from aerojax.geometry.boxes import tight_box
from aerojax.segment.voxel_vote.background import Difference, grey
from aerojax.segment.voxel_vote.cluster import Region

ACROSS = 7
"""Pixels along a side of the neighbourhoods whose texture is compared."""
TEXTURE = 0.01
"""Standard deviation of a neighbourhood, grey, from which on it has a texture to recognise."""
LEAST_CHANGE = 0.02
"""Difference of a pixel, sRGB, whose gain tells anything."""
ALIKE_GAINS = 0.02
"""Standard deviation of a shadow's gain, which is the same all over; shaded objects have several times that."""
FEWEST_PIXELS = 12
"""Of a region that is compared with its background as a whole."""


@dataclass(frozen=True)
class CueConfig:
    """From a difference to a weight.

    deviations: of a pixel, at which its weight leaves 0 and reaches 1.
    least: difference, sRGB, at which the weight reaches 1; from half of it on it counts.
    alike: correlation with the background, from which on a neighbourhood is background in other light: a cast shadow,
        the shadow of a cloud.
    """

    deviations: tuple[float, float] = (3.0, 6.0)
    least: float = 0.03
    alike: float = 0.8


def motion_weight(
    image: Float32[np.ndarray, "height width 3"], seen: Difference, config: CueConfig
) -> Float32[np.ndarray, "height width"]:
    """Weight of each pixel, 0..1: a ramp of its difference in deviations and in brightness, none for mere light."""
    size = cv2.GaussianBlur(seen.size, (0, 0), 0.6)
    low, high = config.deviations
    weight = _ramp(size / seen.deviation, low, high) * _ramp(size, config.least / 2, config.least)
    box = tight_box(weight > 0)
    if box is not None:
        x0, y0, x1, y1 = map(int, box)
        window = np.s_[max(y0 - ACROSS, 0) : y1 + ACROSS, max(x0 - ACROSS, 0) : x1 + ACROSS]
        still = np.ascontiguousarray(seen.predicted[window])
        weight[window] *= 1 - _light(grey(np.ascontiguousarray(image[window])), grey(still), config.alike)
    return weight


def _ramp(value: Float32[np.ndarray, "height width"], low: float, high: float) -> Float32[np.ndarray, "height width"]:
    return np.clip((value - np.float32(low)) * np.float32(1 / (high - low)), 0, 1)


def _light(
    image: Float32[np.ndarray, "height width"], predicted: Float32[np.ndarray, "height width"], alike: float
) -> Float32[np.ndarray, "height width"]:
    """Where the background's own texture shows through, 0..1.

    Normalised cross-correlation of 7×7 neighbourhoods (Jacques, Jung & Musse 2005). Where the background has no
    texture nothing shows, and what differs is an object.
    """
    mean_a, mean_b = _mean(image), _mean(predicted)
    var_a, var_b = _mean(image * image) - mean_a * mean_a, _mean(predicted * predicted) - mean_b * mean_b
    both = (_mean(image * predicted) - mean_a * mean_b) / np.sqrt(cv2.max(var_a * var_b, 1e-12))
    return np.where(var_b > TEXTURE**2, _ramp(both, alike, (1 + alike) / 2), np.float32(0))


def _mean(image: Float32[np.ndarray, "height width"]) -> Float32[np.ndarray, "height width"]:
    return cv2.blur(image, (ACROSS, ACROSS))


def unlike_background(
    image: Float32[np.ndarray, "height width 3"],
    seen: Difference,
    region: Region,
    config: CueConfig,
) -> float | None:
    """How badly other light explains a region's changed pixels: 0 for its own background, about 1 for an object.

    The lesser of two measures. One gain for all of it: the median absolute residual of image = gain · background over
    the same deviation of gain · background. And, for shadows too thin for that, whose rim is most of them: one less the
    correlation of the logarithms' steps from pixel to pixel, along rows or along columns, whichever shows more.

    Returns:
        None where the background has no texture to recognise, or too few pixels changed; their weight does not matter,
        because it is small where light was recognised already.
    """
    size, deviation = seen.size[region.window], seen.deviation[region.window]
    changed = (size > np.maximum(config.deviations[0] * deviation, config.least)) & region.inside
    if np.count_nonzero(changed) < FEWEST_PIXELS:
        return None
    a, b = (grey(np.ascontiguousarray(one[region.window])) for one in (image, seen.predicted))
    inside_a, inside_b = a[changed], b[changed]
    gain = float(np.median(inside_a / np.maximum(inside_b, 1e-3)))
    inside_b = gain * inside_b
    texture = float(np.median(np.abs(inside_b - np.median(inside_b))))
    if 1.5 * texture <= TEXTURE * gain:
        return None
    log_a, log_b = (np.log(np.maximum(one, 0) + np.float32(0.02)) for one in (a, b))
    steps = max(_step_correlation(log_a, log_b, changed), _step_correlation(log_a.T, log_b.T, changed.T))
    return min(float(np.median(np.abs(inside_a - inside_b))) / texture, 1 - steps)


def common_gain(
    image: Float32[np.ndarray, "height width 3"], seen: Difference, region: Region
) -> Float32[np.ndarray, "3"] | None:
    """What a region's background is multiplied by, if it is the same darkening for all pixels: a shadow's inside.

    Only pixels that differ by half as much as the one that differs most count: a rim is a mixture.

    Returns:
        One gain a channel; None where too few pixels changed, or their gains differ, or one is no darkening.
    """
    size = seen.size[region.window] * region.inside
    inside = size >= max(0.5 * float(size.max()), LEAST_CHANGE)
    if np.count_nonzero(inside) < FEWEST_PIXELS:
        return None
    gains = image[region.window][inside] / np.maximum(seen.predicted[region.window][inside], np.float32(1e-3))
    gain = np.median(gains, axis=0)
    spread = 1.4826 * float(np.median(np.abs(gains - gain), axis=0).max())
    return gain if spread <= ALIKE_GAINS and float(gain.max()) < 1 else None


def _step_correlation(
    a: Float32[np.ndarray, "rows columns"],
    b: Float32[np.ndarray, "rows columns"],
    changed: Bool[np.ndarray, "rows columns"],
) -> float:
    """Correlation of the differences between neighbours in a row that both changed; 0 of few or without texture."""
    both = changed[:, 1:] & changed[:, :-1]
    if np.count_nonzero(both) < FEWEST_PIXELS:
        return 0.0
    step_a, step_b = np.diff(a, axis=1)[both], np.diff(b, axis=1)[both]
    if float(np.sqrt(np.mean(step_b * step_b))) < TEXTURE:
        return 0.0
    return float(step_a @ step_b / np.sqrt((step_a @ step_a) * (step_b @ step_b) + 1e-12))
