"""Crops as cameras far away or behind trees would have recorded them: large pixels, and things in the way."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Key

_MOST_OF_A_CROP = 0.9
"""Widest thing in the way, over the crop's side."""
_LEAST_LEFT = 0.1
"""Share of its pixels that a silhouette keeps; of what is hidden further nothing is seen."""
_CLOSEST = 0.2
"""Smallest window about what is left, over the crop's side."""
_DRIFT = 0.05
"""Standard deviation of how far things move before the object from frame to frame, over the crop's side."""
_STRIPS = 2
"""Things in the way of one camera, some of them beside the object."""
_THRESHOLDS = (0.15, 0.5)
"""Least coverage of a large pixel that belongs to a mask, as `FaultRanges.mask_threshold` has it."""


def hide(
    coverage: Float[Array, "time view size size"], share: float, *, key: Key[Array, ""]
) -> Bool[Array, "time view size size"]:
    """What straight things in the way leave to be seen; in `share` of the clips, of about half of their cameras.

    Each is a strip of some direction, width and place, which drifts evenly over the clip: trunks and poles, and where
    it is wide the edge of something large.
    """
    time, views, size, _ = coverage.shape
    some, camera, angle_key, width_key, place_key, drift_key = jax.random.split(key, 6)
    hides = jax.random.bernoulli(some, share) & jax.random.bernoulli(camera, 0.5, (views,))
    shape = (views, _STRIPS)
    angle = jax.random.uniform(angle_key, shape, coverage.dtype, maxval=2 * jnp.pi)
    half = 0.5 * jax.random.uniform(width_key, shape, coverage.dtype, minval=0.1, maxval=_MOST_OF_A_CROP)
    place = jax.random.uniform(place_key, shape, coverage.dtype, minval=-0.75, maxval=0.75)
    speed = _DRIFT * jax.random.normal(drift_key, shape, coverage.dtype)
    moment = jnp.arange(time, dtype=coverage.dtype) - jnp.asarray((time - 1) / 2, coverage.dtype)
    middle = place[None] + moment[:, None, None] * speed[None]
    at = (jnp.arange(size, dtype=coverage.dtype) + jnp.asarray(0.5 - size / 2, coverage.dtype)) / size
    across = jnp.cos(angle)[..., None, None] * at[None, None, None, :]
    across = across + jnp.sin(angle)[..., None, None] * at[None, None, :, None]
    covered = (jnp.abs(across[None] - middle[..., None, None]) < half[None, ..., None, None]).any(axis=2)
    return ~(covered & hides[None, :, None, None])


def seen_window(
    before: Float[Array, "time view size size"], after: Float[Array, "time view size size"]
) -> tuple[Float[Array, "time view"], Float[Array, "time view 2"], Bool[Array, "time view"]]:
    """The window that is cut about a silhouette of which a part is hidden.

    Args:
        before: coverage of the whole silhouette. after: of what is left.

    Returns:
        side: of the new window over the crop's. middle: of it, x y from the crop's middle, pixels. left: whether
        enough is seen to cut one. Where nothing is hidden, the window is the crop itself.
    """
    whole, size = _middle_and_side(before), before.shape[-1]
    rest = _middle_and_side(after)
    hidden = jnp.sum(after, axis=(-2, -1)) < 0.999 * jnp.sum(before, axis=(-2, -1))
    left = jnp.sum(after, axis=(-2, -1)) >= _LEAST_LEFT * jnp.sum(before, axis=(-2, -1))
    moved = hidden & left
    side = jnp.clip(rest[1] / jnp.maximum(whole[1], 1.0), _CLOSEST, 1.0)
    middle = rest[0] - jnp.asarray(size / 2, before.dtype)
    return jnp.where(moved, side, 1.0), jnp.where(moved[..., None], middle, 0.0), left


def _middle_and_side(
    coverage: Float[Array, "time view size size"],
) -> tuple[Float[Array, "time view 2"], Float[Array, "time view"]]:
    """Of the box about what is covered by half or more, pixels of the crop; the crop's own where that is nothing."""
    size, shown = coverage.shape[-1], coverage >= 0.5
    ends = []
    for axis in (-2, -1):  # columns, then rows
        line = shown.any(axis=axis)
        first = jnp.argmax(line, axis=-1)
        last = size - jnp.argmax(line[..., ::-1], axis=-1)
        some = line.any(axis=-1)
        ends.append((jnp.where(some, first, 0), jnp.where(some, last, size)))
    low, high = (jnp.stack([end[i] for end in ends], axis=-1).astype(coverage.dtype) for i in (0, 1))
    return 0.5 * (low + high), jnp.max(high - low, axis=-1)


def coarsen(
    rgba: Float[Array, "time view size size 4"], share: float, fewest: float, *, key: Key[Array, ""]
) -> Float[Array, "time view size size 4"]:
    """Crops of images with large pixels, between `fewest` and as many as the crop has across; in `share` of the clips.

    A pixel records the mean of what it covers, belongs to the mask or does not, and the crop is drawn from those
    pixels, bilinear. Pixels lie elsewhere in every frame, because the object moves.
    """
    time, views, size = rgba.shape[:3]
    some, clip_key, camera_key, place_key, threshold_key = jax.random.split(key, 5)
    most = jnp.log(jnp.asarray(size / fewest, rgba.dtype))
    ratio = most * jax.random.uniform(clip_key, dtype=rgba.dtype)
    ratio = ratio + jax.random.uniform(camera_key, (views,), rgba.dtype, minval=-0.2, maxval=0.2)
    pitch = jnp.exp(jnp.clip(ratio, 0.0, most))
    place = jax.random.uniform(place_key, (time, views, 2), rgba.dtype)
    low, high = _THRESHOLDS
    threshold = jax.random.uniform(threshold_key, dtype=rgba.dtype, minval=low, maxval=high)
    one = jax.vmap(jax.vmap(_recorded, in_axes=(0, 0, 0, None)), in_axes=(0, None, 0, None))
    return jnp.where(jax.random.bernoulli(some, share), one(rgba, pitch, place, threshold), rgba)


def _recorded(
    crop: Float[Array, "size size 4"], pitch: Float[Array, ""], place: Float[Array, "2"], threshold: Float[Array, ""]
) -> Float[Array, "size size 4"]:
    """One crop whose pixels are `pitch` wide, shifted by a share of that each way."""
    (into_x, out_of_x), (into_y, out_of_y) = (_pixels(crop.shape[0], pitch, place[i]) for i in (0, 1))
    mean = jnp.einsum("ai,bj,ijc->abc", into_y, into_x, crop)
    coverage = mean[..., 3:]
    colour = mean[..., :3] / jnp.maximum(coverage, 1e-6)
    mask = (coverage > threshold).astype(crop.dtype)
    pixels = jnp.concatenate([jnp.minimum(colour, 1.0) * mask, mask], axis=-1)
    return jnp.einsum("ia,jb,abc->ijc", out_of_y, out_of_x, pixels)


def _pixels(
    size: int, pitch: Float[Array, ""], place: Float[Array, ""]
) -> tuple[Float[Array, "pixel size"], Float[Array, "size pixel"]]:
    """Along one axis: shares of the crop's samples in each large pixel, and of those in each sample."""
    count = size + 2
    start = (jnp.arange(count, dtype=pitch.dtype) - place) * pitch
    sample = jnp.arange(size, dtype=pitch.dtype)
    low = jnp.maximum(start[:, None], sample[None])
    high = jnp.minimum(start[:, None] + pitch, sample[None] + 1)
    into = jnp.maximum(high - low, 0.0) / pitch
    at = (sample[:, None] + 0.5) / pitch + place - 0.5
    out = jnp.maximum(1.0 - jnp.abs(at - jnp.arange(count, dtype=pitch.dtype)[None]), 0.0)
    return into, out
