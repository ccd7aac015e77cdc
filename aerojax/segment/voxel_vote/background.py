"""What one camera sees where nothing moves, as mean and variance of every pixel, learnt as frames pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from aerojax.core.colour import as_bytes
from aerojax.segment.voxel_vote.mixture import Mixture, mixture_of
from aerojax.segment.voxel_vote.registration import (
    LEAST_OFFSET,
    STILL,
    Offset,
    coarse,
    displaced,
    offset_of,
    reduction,
    slopes,
)

GAIN_BLOCK = 16
"""Columns of blocks in which the illumination is compared: a block is larger than what flies, smaller than a cloud."""
MOST_LOCAL_GAIN = 1.2
"""Brightness of one region against the whole image's; what differs more is no change of light."""
DARK = 0.02
"""Added to both sides of a ratio of brightness, sRGB: black has none."""
GREATEST_DEVIATION = 0.15
"""SRGB; an object that was not recognised must not blind its pixels."""
USUAL = 10.0
"""Standard deviation of a pixel that the mixture calls background, sRGB: nothing differs from it."""
EVERY = 3
"""Frames from one update of a camera's background to the next: it changes slowly, and an update costs a third."""
_STRIP = 1 << 18
"""Values a strip when medians are sought: bounded memory for images of any size."""


@dataclass(frozen=True)
class BackgroundConfig:
    """How a background is learnt.

    model: mean and variance alone (`running`), or OpenCV's mixture of Gaussians besides, which knows several values of
        a pixel that comes and goes, costs more and cannot be stored (`mixture`).
    memory: frames after which a change has become background to 63 %.
    warm_up: frames before a background that nothing is known of; one in three is kept, and their median begins it.
    noise: least standard deviation of a pixel, sRGB.
    registration_px: standard deviation of what is left of a camera's sway, pixels: steep pixels vary that much more.
    """

    model: Literal["running", "mixture"] = "running"
    memory: float = 90.0
    warm_up: int = 24
    noise: float = 0.008
    registration_px: float = 0.15


@dataclass(frozen=True, eq=False)
class Background:
    """Running model of one camera.

    mean: sRGB. variance: of the channel that varies most. grey: `coarse` of the mean, with which frames are registered.
    before: the last image's grey values, where the mean stands; None before there is one.
    mixture: where the configuration asks for one.
    """

    mean: Float32[np.ndarray, "height width 3"]
    variance: Float32[np.ndarray, "height width"]
    grey: Float32[np.ndarray, "rows columns"]
    before: Float32[np.ndarray, "height width"] | None = None
    mixture: Mixture | None = None


@dataclass(frozen=True, eq=False)
class Difference:
    """How one image differs from what the background predicts.

    size: of the channel that differs most, sRGB. deviation: its standard deviation if nothing moved.
    predicted: the background in this image's light and place.
    offset: by which the image is displaced, pixels.
    recent: size of the grey values' change since the last frame; zero where none is known.
    """

    size: Float32[np.ndarray, "height width"]
    deviation: Float32[np.ndarray, "height width"]
    predicted: Float32[np.ndarray, "height width 3"]
    offset: Offset
    recent: Float32[np.ndarray, "height width"] | None


def learnt(images: Sequence[UInt8[np.ndarray, "height width 3"]], config: BackgroundConfig) -> Background:
    """The background of a camera's images: their median, right where an object covers a pixel less than half the time.

    The variance comes from the median absolute deviation (σ = 1.4826·MAD), which an object that passes leaves alone.
    """
    shape = images[0].shape
    mean, spread = np.empty(images[0].size, np.float32), np.empty(images[0].size, np.float32)
    flat = [image.reshape(-1) for image in images]
    for start in range(0, mean.size, _STRIP):
        part = slice(start, start + _STRIP)
        values = [one[part] for one in flat]
        middle = _median(values)
        mean[part] = middle * np.float32(1 / 255)
        spread[part] = _median([np.abs(one - middle) for one in values]) * np.float32(1.4826 / 255)
    mean, deviation = mean.reshape(shape), largest_channel(spread.reshape(shape))
    known = Background(mean, np.minimum(deviation, GREATEST_DEVIATION) ** 2, coarse(mean))
    if config.model == "running":
        return known
    return replace(known, mixture=mixture_of(images, as_bytes(mean), max(1, round(config.memory))))


def _median(values: Sequence[np.ndarray]) -> Float32[np.ndarray, "value"]:
    """Elementwise median by Batcher's merge exchange (Knuth, The Art of Computer Programming 3, 5.2.2 M).

    Whole arrays are compared at once, which takes a thirtieth of the time of sorting every pixel's few values.
    """
    values, count = list(values), len(values)
    top = 1 << max(count - 1, 1).bit_length() - 1
    step = top
    while step:
        span, rest, apart = top, 0, step
        while True:
            for low in (i for i in range(count - apart) if i & step == rest):
                a, b = values[low], values[low + apart]
                values[low], values[low + apart] = np.minimum(a, b), np.maximum(a, b)
            if span == step:
                break
            apart, span, rest = span - step, span >> 1, step
        step >>= 1
    return (values[(count - 1) // 2].astype(np.float32) + values[count // 2]) * np.float32(0.5)


def difference_of(
    image: Float32[np.ndarray, "height width 3"], known: Background, config: BackgroundConfig
) -> Difference:
    """What in an image the background does not explain, its light and the camera's sway taken out."""
    factor = reduction(image.shape[1])
    right, down = offset_of(coarse(image), known.grey)
    offset = (right * factor, down * factor)
    return difference_at(STILL if max(map(abs, offset)) < LEAST_OFFSET else offset, image, known, config)


def difference_at(
    offset: Offset, image: Float32[np.ndarray, "height width 3"], known: Background, config: BackgroundConfig
) -> Difference:
    """`difference_of` for an image of which the displacement is known, pixels."""
    predicted = _in_this_light(displaced(known.mean, offset), image)
    size = largest_channel(cv2.absdiff(image, predicted))
    slope = cv2.magnitude(*slopes(grey(predicted)))
    noise = max(config.noise, 1.4826 * float(np.median(size[::4, ::4])))
    variance = displaced(known.variance, offset) + np.float32(noise**2)
    variance += np.float32(config.registration_px**2) * slope * slope
    recent = None if known.before is None else cv2.absdiff(grey(image), displaced(known.before, offset))
    seen = Difference(size, np.sqrt(variance), predicted, offset, recent)
    if known.mixture is None:
        return seen
    moves = known.mixture.foreground(as_bytes(as_background(image, seen, known)))
    usual = displaced((~moves).astype(np.uint8), offset) > 0
    return replace(seen, deviation=np.where(usual, np.float32(USUAL), seen.deviation))


def after(
    image: Float32[np.ndarray, "height width 3"],
    seen: Difference,
    known: Background,
    objects: Bool[np.ndarray, "height width"],
    config: BackgroundConfig,
) -> Background:
    """The background after `EVERY` more images, of which this is the last.

    mean += a (image - mean), variance += 2a (size² - variance) with a = `EVERY`/memory, except where objects are (Wren
    et al. 1997, with the objects that the cameras agree on).

    Args:
        objects: pixels that are no background.
    """
    back = (-seen.offset[0], -seen.offset[1])
    steady, free = displaced(image, back), displaced((~objects).astype(np.uint8), back)
    squared = cv2.min(displaced(seen.size, back), GREATEST_DEVIATION)
    mean, variance = known.mean.copy(), known.variance.copy()
    rate = min(1.0, EVERY / config.memory)
    cv2.accumulateWeighted(steady, mean, rate, free)
    cv2.accumulateWeighted(squared * squared, variance, min(1.0, 2 * rate), free)
    mixture = known.mixture
    if mixture is not None:
        shown = np.where(free[..., None] > 0, as_background(image, seen, known), known.mean)
        mixture = mixture.after(as_bytes(shown), rate)
    return replace(known, mean=mean, variance=variance, grey=coarse(mean), mixture=mixture)


def followed(image: Float32[np.ndarray, "height width 3"], seen: Difference, known: Background) -> Background:
    """The background as it was, with this image as the last one."""
    return replace(known, before=displaced(grey(image), (-seen.offset[0], -seen.offset[1])))


def as_background(
    image: Float32[np.ndarray, "height width 3"], seen: Difference, known: Background
) -> Float32[np.ndarray, "height width 3"]:
    """An image in the background's light, where the background stands."""
    light = displaced(known.mean, seen.offset) + np.float32(DARK)
    light /= cv2.max(seen.predicted + np.float32(DARK), 1e-3)
    return displaced(image * light, (-seen.offset[0], -seen.offset[1]))


def grey(image: Float32[np.ndarray, "height width 3"]) -> Float32[np.ndarray, "height width"]:
    """Luma of an sRGB image."""
    return cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)


def largest_channel(image: Float32[np.ndarray, "height width 3"]) -> Float32[np.ndarray, "height width"]:
    """The greatest of a pixel's three values."""
    red, green, blue = cv2.split(image)
    return cv2.max(cv2.max(red, green), blue)


def _in_this_light(
    still: Float32[np.ndarray, "height width 3"], image: Float32[np.ndarray, "height width 3"]
) -> Float32[np.ndarray, "height width 3"]:
    """The background as bright as the image: a gain of each channel and a smooth one of each region about it.

    The regions' gains pass a median of five by five blocks, so that an object of up to half of them leaves no trace.
    """
    height, width = image.shape[:2]
    size = (GAIN_BLOCK, max(1, round(GAIN_BLOCK * height / width)))
    shrunk = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) + np.float32(DARK) for one in (image, still)]
    ratio = shrunk[0] / shrunk[1]
    whole = np.median(ratio.reshape(-1, 3), axis=0).astype(np.float32)
    local = np.stack([cv2.medianBlur(np.ascontiguousarray(ratio[..., c] / whole[c]), 5) for c in range(3)], axis=-1)
    gain = whole * np.clip(local, 1 / MOST_LOCAL_GAIN, MOST_LOCAL_GAIN)
    gain = cv2.resize(gain, (width, height), interpolation=cv2.INTER_LINEAR)
    light = still + np.float32(DARK)
    light *= gain
    light -= np.float32(DARK)
    return light
