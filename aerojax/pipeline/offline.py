"""Stage 4: a capture in, a label out.

Reconstruction runs in the rig's frame: the first camera's axes and centre. Grids, seeds and farthest points are then
the same numbers however the world is placed, and only the finished Gaussians are moved to the world.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Key

from aerojax.capture.format import Capture
from aerojax.capture.frames import read_mask, read_rgb
from aerojax.classify.released.normalisation import normalise_published
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.core.errors import UserError
from aerojax.core.types import Camera, Gaussians, View
from aerojax.gaussians.decimate import DecimationConfig, decimate
from aerojax.gaussians.rotate import transform
from aerojax.geometry.boxes import Box, tight_box, touches_border
from aerojax.geometry.triangulation import intersect_rays
from aerojax.reconstruct.crop import crop_cameras, crop_image
from aerojax.reconstruct.hull import HullConfig, visual_hull
from aerojax.segment.given import choose_object
from aerojax.segment.motion import background, motion_mask

Progress = Callable[[int, int, str], None]
"""Called with (done, total, what) as frames pass."""


@dataclass(frozen=True)
class PipelineConfig:
    """From images to tokens.

    crop_size: side of the virtual-camera crops, pixels.
    min_views: cameras that must see the whole object; a frame with fewer is dropped.
    hull: the reconstructor.
    decimation: from the reconstructor's Gaussians to the classifier's tokens.
    """

    crop_size: int = 128
    min_views: int = 3
    hull: HullConfig = field(default_factory=HullConfig)
    decimation: DecimationConfig = field(default_factory=DecimationConfig)


@dataclass(frozen=True)
class FrameImages:
    """What the cameras of one frame saw of the object: crops for the reconstructor, and the boxes for people."""

    frame: int
    views: View
    valid: Bool[np.ndarray, "view"]
    boxes: tuple[Box | None, ...]
    rig_from_crop: Float[np.ndarray, "4 4"]


@dataclass(frozen=True)
class Clip:
    """The object in every usable frame.

    gaussians: world frame, metres, leading axis time.
    frames: indices in the capture.
    position: triangulated centres, metres, world.
    dropped: unusable frames and why.
    latency_ms: median milliseconds a frame, per stage.
    images: per frame, what was seen (kept only on request).
    """

    gaussians: Gaussians
    frames: tuple[int, ...]
    position: Float[np.ndarray, "time 3"]
    dropped: dict[int, str]
    latency_ms: dict[str, float]
    images: tuple[FrameImages, ...] = ()


class Stopwatch:
    """Wall-clock milliseconds by stage name."""

    def __init__(self) -> None:
        self.spent: dict[str, list[float]] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time of the block to `name`."""
        start = time.perf_counter()
        yield
        self.spent.setdefault(name, []).append(1e3 * (time.perf_counter() - start))

    def medians(self) -> dict[str, float]:
        """The median of each stage; robust against the first call, which compiles."""
        return {name: float(np.median(times)) for name, times in self.spent.items()}


def reconstruct_capture(
    capture: Capture,
    config: PipelineConfig,
    *,
    key: Key[Array, ""],
    object_id: int | None = None,
    progress: Progress | None = None,
    keep_images: bool = False,
) -> Clip:
    """Reconstruct the object in every frame of a capture.

    Args:
        capture: at least three calibrated cameras.
        config: sizes of each stage.
        key: seeds the decimation, frame by frame.
        object_id: instance to follow; the largest one if None. Ignored where the capture has no masks.
        progress: called after each frame.
        keep_images: keep crops and boxes in the clip, for a report.

    Raises:
        UserError: if no frame has enough views.
    """
    watch = Stopwatch()
    source = _MaskSource(capture, object_id)
    kept: list[tuple[Gaussians, FrameImages, np.ndarray]] = []
    dropped: dict[int, str] = {}
    for frame in range(capture.frames):
        seen = _see(capture, source, frame, config, watch)
        if isinstance(seen, str):
            dropped[frame] = seen
        else:
            tokens, count = _reconstruct(seen, config, jax.random.fold_in(key, frame), watch)
            if count == 0:
                dropped[frame] = (
                    "the silhouettes of the cameras do not meet: check calibration, masks and synchronisation"
                )
            else:
                world_from_crop = capture.cameras[0].world_from_cam @ seen.rig_from_crop
                placed = transform(tokens, jnp.asarray(world_from_crop, jnp.float32))
                kept.append((placed, seen, world_from_crop[:3, 3]))
        if progress is not None:
            progress(frame + 1, capture.frames, "reconstruct")
    if not kept:
        reasons = "; ".join(sorted(set(dropped.values())))
        raise UserError(
            "no-usable-frames",
            f"{capture.folder}: none of the {capture.frames} frames could be used ({reasons})",
            "give frames in which more cameras see the whole object",
        )
    gaussians = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(k[0] for k in kept))
    return Clip(
        gaussians=gaussians,
        frames=tuple(k[1].frame for k in kept),
        position=np.stack([k[2] for k in kept]),
        dropped=dropped,
        latency_ms=watch.medians(),
        images=tuple(k[1] for k in kept) if keep_images else (),
    )


def frame_images(capture: Capture, frame: int, config: PipelineConfig, *, object_id: int | None = None) -> FrameImages:
    """What the cameras of one frame saw of the object, as `reconstruct_capture` cuts it out.

    Raises:
        UserError: if there is no such frame, or fewer than `config.min_views` cameras see the whole object in it.
    """
    if not 0 <= frame < capture.frames:
        raise UserError(
            "out-of-range",
            f"frame={frame}: {capture.folder} has frames 0 to {capture.frames - 1}",
            "choose one of them",
        )
    seen = _see(capture, _MaskSource(capture, object_id), frame, config, Stopwatch())
    if isinstance(seen, str):
        raise UserError("invalid", f"{capture.folder}: frame {frame}: {seen}", "choose another frame")
    return seen


class _MaskSource:
    """Masks of one object: the capture's own where it has them, else motion against a static background."""

    def __init__(self, capture: Capture, object_id: int | None):
        self._capture = capture
        self._still: dict[int, np.ndarray] = {}
        self._object = None
        if any(camera.mask for camera in capture.cameras):
            self._object = choose_object(capture_masks(capture), object_id)

    def mask(self, camera: int, frame: int, image: np.ndarray) -> np.ndarray | None:
        """Coverage 0..1 of the object in one image."""
        if self._capture.cameras[camera].mask is not None:
            ids = read_mask(self._capture, camera, frame)
            return None if ids is None else (ids == self._object).astype(np.float32)
        if camera not in self._still:
            every = np.unique(np.linspace(0, self._capture.frames - 1, 15).astype(int))
            images = [read_rgb(self._capture, camera, int(f)) for f in every]
            self._still[camera] = background([i for i in images if i is not None])
        return motion_mask(image, self._still[camera]).astype(np.float32)


def capture_masks(capture: Capture) -> Iterator[np.ndarray]:
    """Masks of all cameras, a few frames spread over the capture."""
    for frame in np.unique(np.linspace(0, capture.frames - 1, 5).astype(int)):
        for index in range(len(capture.cameras)):
            mask = read_mask(capture, index, int(frame))
            if mask is not None:
                yield mask


def _see(
    capture: Capture, source: _MaskSource, frame: int, config: PipelineConfig, watch: Stopwatch
) -> FrameImages | str:
    """Read one frame and cut out the object; a sentence instead where too few cameras see it whole."""
    images: list[tuple[np.ndarray, np.ndarray] | None] = []
    boxes: list[Box | None] = []
    with watch.stage("read"):
        for index, camera in enumerate(capture.cameras):
            image = read_rgb(capture, index, frame)
            mask = None if image is None else source.mask(index, frame, image)
            box = None if mask is None else tight_box(mask > 0.5, min_pixels=4)
            whole = box is not None and not touches_border(box, camera.width, camera.height)
            boxes.append(box)
            images.append((image, mask) if whole and image is not None and mask is not None else None)
    valid = np.array([i is not None for i in images])
    if valid.sum() < config.min_views:
        return f"{valid.sum()} of {len(valid)} cameras see the whole object, {config.min_views} are needed"
    with watch.stage("crop"):
        views, rig_from_crop = _crop(capture, images, boxes, config.crop_size)
    return FrameImages(frame, views, valid, tuple(boxes), rig_from_crop)


def _crop(
    capture: Capture, images: list[tuple[np.ndarray, np.ndarray] | None], boxes: list[Box | None], size: int
) -> tuple[View, np.ndarray]:
    """Crops in a frame with the rig's axes and the object at its origin."""
    valid = np.array([i is not None for i in images])
    rig_from_world = np.linalg.inv(capture.cameras[0].world_from_cam)
    poses = np.stack([rig_from_world @ c.world_from_cam for c in capture.cameras])
    fallback = next(b for b, ok in zip(boxes, valid, strict=True) if ok)
    box = np.array([b if b is not None and ok else fallback for b, ok in zip(boxes, valid, strict=True)], np.float64)
    crops = crop_cameras(np.stack([c.K for c in capture.cameras]), poses, box, size=size)
    with jax.enable_x64(True):
        weights = jnp.asarray(valid, jnp.float64)
        centre = np.asarray(intersect_rays(jnp.asarray(poses[:, :3, 3]), jnp.asarray(crops.ray), weights))
    local = np.array(crops.camera.world_from_cam)
    local[:, :3, 3] -= centre
    homographies = np.asarray(crops.crop_from_image)
    rgb = np.zeros((len(images), size, size, 3), np.float32)
    mask = np.zeros((len(images), size, size), np.float32)
    for index, pair in enumerate(images):
        if pair is not None:
            rgb[index] = crop_image(pair[0], homographies[index], size=size)
            mask[index] = crop_image(pair[1], homographies[index], size=size)
    camera = Camera(jnp.asarray(crops.camera.K, jnp.float32), jnp.asarray(local, jnp.float32), size, size)
    rig_from_crop = np.eye(4)
    rig_from_crop[:3, 3] = centre
    return View(jnp.asarray(rgb), jnp.asarray(mask), camera), rig_from_crop


def _reconstruct(
    seen: FrameImages, config: PipelineConfig, key: Key[Array, ""], watch: Stopwatch
) -> tuple[Gaussians, int]:
    with watch.stage("reconstruct"):
        gaussians, count = jax.block_until_ready(_hull(seen.views, jnp.asarray(seen.valid), config.hull))
    if int(count) == 0:
        return gaussians, 0
    with watch.stage("decimate"):
        tokens = jax.block_until_ready(_decimate(gaussians, count, key, config.decimation))
    return tokens, int(count)


@partial(jax.jit, static_argnames="config")
def _hull(views: View, valid: Array, config: HullConfig) -> tuple[Gaussians, Array]:
    gaussians, count, _ = visual_hull(views, valid, config=config)
    return gaussians, count


@partial(jax.jit, static_argnames="config")
def _decimate(gaussians: Gaussians, count: Array, key: Array, config: DecimationConfig) -> Gaussians:
    return decimate(gaussians, count=count, key=key, config=config)


@partial(jax.jit, static_argnames=("tokens", "readings"))
def probabilities_so_far(
    model: MambaSplat,
    columns: Float[Array, "time token 14"],
    present: Bool[Array, "time"] | None = None,
    *,
    tokens: int,
    readings: int = 4,
) -> Float[Array, "time label"]:
    """Class probabilities after each frame of a clip; the last row is the answer.

    Frames are described once and every prefix is read out; only the clip's scale is known from all frames at once.

    Args:
        model: either variant; the published one's frames are normalised here, whole, as its authors' are.
        columns: attributes of decimated Gaussians, metres, world frame, in random order within a frame.
        present: frames that are real; all if None.
        tokens: how many of each frame's Gaussians one reading sees, as in training.
        readings: disjoint groups of tokens whose probabilities are averaged, as far as there are enough tokens.
    """
    time = jnp.arange(columns.shape[0])

    def read(features: Float[Array, "time width"], valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
        prefixes = valid & (time[None, :] <= time[:, None])
        return jax.nn.softmax(jax.vmap(lambda mask: model.head(model.embed(features, mask)))(prefixes))

    return _mean_of_readings(model, columns, present, tokens, readings, read)


@partial(jax.jit, static_argnames=("tokens", "readings"))
def clip_probabilities(
    model: MambaSplat,
    columns: Float[Array, "time token 14"],
    present: Bool[Array, "time"] | None = None,
    *,
    tokens: int,
    readings: int = 4,
) -> Float[Array, "label"]:
    """The last row of `probabilities_so_far` without the work for the others."""

    def read(features: Float[Array, "time width"], valid: Bool[Array, "time"]) -> Float[Array, "label"]:
        return jax.nn.softmax(model.head(model.embed(features, valid)))

    return _mean_of_readings(model, columns, present, tokens, readings, read)


def _mean_of_readings(
    model: MambaSplat,
    columns: Float[Array, "time token 14"],
    present: Bool[Array, "time"] | None,
    tokens: int,
    readings: int,
    read: Callable[[Array, Array], Array],
) -> Array:
    """Mean of `read(features, valid)` over disjoint groups of every frame's tokens."""
    groups = max(1, min(readings, columns.shape[1] // tokens))
    size = min(tokens, columns.shape[1])
    real = jnp.ones(columns.shape[0], bool) if present is None else present
    if model.config.variant == "published":
        columns = jax.vmap(normalise_published)(columns)

    def one(group: Float[Array, "time some 14"]) -> Array:
        return read(*model.frame_features(group, jnp.broadcast_to(real[:, None], group.shape[:2])))

    split = columns[:, : groups * size].reshape(columns.shape[0], groups, size, 14)
    return jnp.mean(jax.vmap(one, in_axes=1)(split), axis=0)
