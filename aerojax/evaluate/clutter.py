"""Moving clutter for one camera's images: what a segmenter without masks must not take for an object.

Clouds drift, leaves wave, shadows wander, the light changes, the camera sways and its sensor is noisy. Everything but
the last two lies behind the objects; nothing of it meets in space, because every camera has its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float32, UInt16

from aerojax.core.seeds import seed_of
from aerojax.core.types import FrameSet


@dataclass(frozen=True)
class ClutterConfig:
    """How much of it.

    clouds: greatest opacity of the clouds over the upper two thirds.
    cloud_px: by which they drift, pixels a frame.
    leaves: crowns of trees in the lower third.
    wave_px: by which their leaves wave, pixels at most.
    shadows: dark patches that wander over the lower half, half of them soft and large.
    drift: by which the brightness swings, as a share.
    noise: of the sensor, standard deviation, sRGB.
    sway_px: of the camera, pixels at most about.
    """

    clouds: float = 0.4
    cloud_px: float = 0.7
    leaves: int = 6
    wave_px: float = 2.5
    shadows: int = 4
    drift: float = 0.1
    noise: float = 0.006
    sway_px: float = 1.0


@dataclass(frozen=True, eq=False)
class _Crown:
    """A tree's crown: its centre, half axes, leaves (grey values, larger than the image of it), phase and frequency."""

    box: tuple[int, int, int, int]
    leaves: Float32[np.ndarray, "leaf_rows leaf_columns"]
    inside: Float32[np.ndarray, "rows columns"]
    phase: float
    frequency: float


class Clutter:
    """The clutter of one camera: a function of the frame's number."""

    def __init__(self, width: int, height: int, *, seed: int, config: ClutterConfig) -> None:
        """Draw it.

        Args:
            width, height: pixels.
            seed: of this camera.
            config: how much.
        """
        rng = np.random.default_rng(seed)
        self._config, self._size, self._seed = config, (width, height), seed
        self._sky = _fractal(rng, width + 512, height)
        self._sky_weight = np.clip(1.5 - 2.25 * np.arange(height, dtype=np.float32) / height, 0, 1)[:, None]
        self._crowns = [self._crown(rng) for _ in range(config.leaves)]
        self._shadows = [self._shadow(rng, soft=index % 2 == 0) for index in range(config.shadows)]
        self._turn = rng.uniform(0, 2 * np.pi)

    def seen(
        self,
        image: Float32[np.ndarray, "height width 3"],
        coverage: Float32[np.ndarray, "height width"],
        frame: int,
    ) -> tuple[Float32[np.ndarray, "height width 3"], Float32[np.ndarray, "height width"]]:
        """An image with clutter behind its objects, and where these lie in it.

        Args:
            image: sRGB, 0..1.
            coverage: share of each pixel that objects cover.
            frame: its number.
        """
        behind = self._shaded(self._waving(self._clouded(image, frame), frame), frame)
        mixed = behind + coverage[..., None] * (image - behind)
        mixed, coverage = self._swayed(mixed, frame), self._swayed(coverage, frame)
        rng = np.random.default_rng(seed_of(self._seed, frame))
        light = 1 + self._config.drift * np.sin(2 * np.pi * frame / 90 + self._turn)
        noise = rng.normal(scale=self._config.noise, size=mixed.shape) if self._config.noise else 0.0
        return np.clip(mixed * light + noise, 0, 1).astype(np.float32), coverage

    def ids(self, ids: UInt16[np.ndarray, "height width"], frame: int) -> UInt16[np.ndarray, "height width"]:
        """A mask of instances where the swaying camera sees them: each where it covers a pixel by more than half."""
        moved = np.zeros_like(ids)
        for number in np.unique(ids[ids > 0]):
            moved[self._swayed((ids == number).astype(np.float32), frame) > 0.5] = number
        return moved

    def _swayed(self, image: np.ndarray, frame: int) -> np.ndarray:
        rng = np.random.default_rng(seed_of(self._seed, "sway", frame))
        right, down = 0.6 * self._config.sway_px * np.clip(rng.normal(size=2), -2, 2)
        moved = np.array([[1.0, 0.0, right], [0.0, 1.0, down]])
        return cv2.warpAffine(image, moved, self._size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)

    def _clouded(self, image: np.ndarray, frame: int) -> np.ndarray:
        width, start = self._size[0], self._config.cloud_px * frame % 512
        moved = np.array([[1.0, 0.0, -start], [0.0, 1.0, 0.0]])
        size = (width, self._size[1])
        sky = cv2.warpAffine(self._sky, moved, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        opacity = self._config.clouds * self._sky_weight * np.clip(2 * sky, 0, 1)
        return image + opacity[..., None] * (np.float32(0.95) - image)

    def _crown(self, rng: np.random.Generator) -> _Crown:
        width, height = self._size
        across = round(rng.uniform(0.06, 0.14) * width)
        x, y = round(rng.uniform(0, width - across)), round(rng.uniform(0.7, 0.95) * height)
        rows = min(round(0.8 * across), height - y)
        leaves = cv2.GaussianBlur(rng.normal(size=(rows + 16, across + 16)).astype(np.float32), (0, 0), 1.3)
        u, v = np.meshgrid(np.linspace(-1, 1, across), np.linspace(-1, 1, rows))
        inside = (np.hypot(u, v) < 1).astype(np.float32)
        return _Crown((x, y, across, rows), 0.25 + 0.3 * leaves, inside, rng.uniform(0, 6.3), rng.uniform(0.08, 0.3))

    def _waving(self, image: np.ndarray, frame: int) -> np.ndarray:
        image = image.copy()
        for crown in self._crowns:
            x, y, columns, rows = crown.box
            turn = crown.frequency * frame + crown.phase
            right, down = self._config.wave_px * np.sin(turn), 0.4 * self._config.wave_px * np.sin(1.7 * turn)
            moved = np.array([[1.0, 0.0, right - 8], [0.0, 1.0, down - 8]])
            leaves = cv2.warpAffine(crown.leaves, moved, (columns, rows), flags=cv2.INTER_LINEAR)
            green = leaves[..., None] * np.array([0.8, 1.0, 0.5], np.float32)
            window = image[y : y + rows, x : x + columns]
            window += crown.inside[..., None] * (green - window)
        return image

    def _shadow(self, rng: np.random.Generator, *, soft: bool) -> tuple[np.ndarray, ...]:
        width, height = self._size
        start = rng.uniform([0, 0.55 * height], [width, 0.95 * height])
        speed = rng.uniform(-1, 1, 2) * np.array([2.5, 0.3]) * width / 640
        radius = width * (rng.uniform(0.1, 0.2) if soft else rng.uniform(0.01, 0.03))
        return start, speed, np.array([radius, 0.5 * radius, 0.5 * radius if soft else 1.0])

    def _shaded(self, image: np.ndarray, frame: int) -> np.ndarray:
        height = self._size[1]
        for start, speed, (across, along, edge) in self._shadows:
            x, y = start + speed * frame
            u, v = np.meshgrid((np.arange(self._size[0]) - x) / across, (np.arange(height) - y) / along)
            inside = np.clip((1 - np.hypot(u, v)) * across / edge, 0, 1) * (np.arange(height) > 0.5 * height)[:, None]
            image = image * (1 - 0.4 * inside[..., None]).astype(np.float32)
        return image


def cluttered(frames: FrameSet, clutter: Sequence[Clutter]) -> FrameSet:
    """The frames with each camera's clutter behind what its masks name; without an image or masks nothing changes."""
    pairs = [
        (image, ids) if image is None or ids is None else _seen(one, image, ids, frames.frame)
        for one, image, ids in zip(clutter, frames.rgb, frames.ids, strict=True)
    ]
    return replace(frames, rgb=tuple(image for image, _ in pairs), ids=tuple(ids for _, ids in pairs), coverage=())


def _seen(
    clutter: Clutter,
    image: Float32[np.ndarray, "height width 3"],
    ids: UInt16[np.ndarray, "height width"],
    frame: int,
) -> tuple[Float32[np.ndarray, "height width 3"], UInt16[np.ndarray, "height width"]]:
    return clutter.seen(image, (ids > 0).astype(np.float32), frame)[0], clutter.ids(ids, frame)


def _fractal(rng: np.random.Generator, width: int, height: int) -> Float32[np.ndarray, "rows columns"]:
    """Noise of several scales with mean 0 and standard deviation 0.5."""
    total = np.zeros((height, width), np.float32)
    for octave in range(5):
        cells = max(2, height // (120 >> octave)), max(2, width // (120 >> octave))
        grid = rng.normal(size=cells).astype(np.float32)
        total += cv2.resize(grid, (width, height), interpolation=cv2.INTER_CUBIC) * 0.5**octave
    return total * (0.5 / total.std())
