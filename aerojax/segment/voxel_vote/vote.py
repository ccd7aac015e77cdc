"""Voxels on which the rays of changed pixels meet: a search from coarse to fine (thesis C.3).

A voxel has a camera's vote where its projection holds weight. It is divided as long as enough of the cameras that see
it vote for it; what no number of cameras agrees on ends after a few divisions, and empty space costs nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, Int

from aerojax.capture.format import CaptureCamera
from aerojax.segment.voxel_vote.volume import FEWEST_VIEWS, Volume, seen_by

SHARE = 0.7
"""Of the cameras that see a place, so many must agree, rounded up: 3 of 3 and 4, 4 of 5, 5 of 6 and 7, 6 of 8."""
MOST_LEVELS = 24
"""Divisions, at most: 10 km to a millimetre."""
SOLID = 0.95
"""Share of a voxel's projection that has weight where it is not divided: it lies inside of an object."""
LEAVES = 200
"""Smallest voxels along an image's width, at most: an object of a quarter of it is then tens of thousands of them."""
FINEST = 640
"""Columns of blocks in which weights are summed, at least: three for every smallest voxel."""
LEAF_RADIUS = 1.2
"""Of the ball whose square stands for a smallest voxel's projection, in half sides."""
_CHILDREN = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)


@dataclass(frozen=True)
class VoteConfig:
    """What a consensus is.

    views: cameras that must agree; 0 takes `SHARE` of those that see the place, or see sky there, at least three where
        there are three.
    least_px: weight of a camera's vote, pixels.
    leaf_px: side of the smallest voxels, pixels; in wide images a `LEAVES`th of the width if that is more.
    reach: see `monitored_volume`.
    most_voxels: of one size; of more, those with the most votes are kept.
    """

    views: int = 0
    least_px: float = 2.0
    leaf_px: float = 6.0
    reach: float = 20.0
    most_voxels: int = 40_000


@dataclass(frozen=True, eq=False)
class Voxels:
    """Cubes that enough cameras vote for.

    centres, half: metres, in the frame of the cameras. votes: weight of each camera, pixels. seen: by which cameras;
    where those before whose sky it lies decide alone, by these and by those that vote.
    """

    centres: Float64[np.ndarray, "voxel 3"]
    half: Float64[np.ndarray, "voxel"]
    votes: Float64[np.ndarray, "camera voxel"]
    seen: Bool[np.ndarray, "camera voxel"]

    def __getitem__(self, kept: np.ndarray) -> Voxels:
        """Some of them, by index or mask."""
        return Voxels(self.centres[kept], self.half[kept], self.votes[:, kept], self.seen[:, kept])


def needed_views(seen: Int[np.ndarray, "place"], config: VoteConfig) -> Int[np.ndarray, "place"]:
    """How many of the cameras that see a place must agree."""
    if config.views:
        return np.full_like(seen, config.views)
    return np.maximum(np.minimum(seen, FEWEST_VIEWS), np.ceil(SHARE * seen - 1e-9).astype(seen.dtype))


def vote(
    volume: Volume,
    weights: Sequence[Float32[np.ndarray, "_ _"] | None],
    config: VoteConfig,
    sky: Sequence[Bool[np.ndarray, "_ _"] | None] = (),
) -> Voxels:
    """The smallest voxels on which enough cameras agree, of all that see them or of those that see sky there.

    Args:
        weights: of each camera's pixels, 0..1; None for a camera that recorded nothing.
        sky: where each camera's background hides nothing, in images of any size; empty if that is not known.
    """
    sums = [None if weight is None else _sums(weight) for weight in weights]
    open_to = sky or [None] * len(sums)
    skies = [None if one is None else _sky_sums(one, c) for one, c in zip(open_to, volume.cameras, strict=True)]
    fewest = min(FEWEST_VIEWS, sum(one is not None for one in sums))
    # One camera, or none, has nothing to agree with.
    centres, half = volume.centres if fewest > 1 else volume.centres[:0], volume.half
    leaves: list[Voxels] = []
    for _ in range(MOST_LEVELS):
        poll = _polled(volume, sums, skies, centres, half, config)
        found, inner = _agreed(poll, config, fewest, any(one is not None for one in skies))
        kept, ends = found[inner], (poll.leaf | poll.solid)[inner]
        leaves.append(kept[ends])
        centres = _strongest(kept[~ends], config.most_voxels // 8).centres
        if not len(centres):
            break
        half /= 2
        centres = (centres[:, None] + half * _CHILDREN).reshape(-1, 3)
    return _joined(leaves)


@dataclass(frozen=True, eq=False)
class _Sums:
    """Integral image of one camera's weights.

    total: sums above and left of the corners of blocks of pixels. block: columns and rows of one.
    """

    total: Float64[np.ndarray, "rows columns"]
    block: Float64[np.ndarray, "2"]


def _sums(weight: Float32[np.ndarray, "height width"]) -> _Sums:
    """Of wide images in blocks of two, three and so on: the smallest voxels are larger."""
    height, width = weight.shape
    factor = max(1, width // FINEST)
    if factor == 1:
        return _Sums(cv2.integral(weight), np.ones(2))
    size = width // factor, height // factor
    block = np.array([width / size[0], height / size[1]])
    return _Sums(cv2.integral(cv2.resize(weight, size, interpolation=cv2.INTER_AREA)) * block.prod(), block)


def _sky_sums(sky: Bool[np.ndarray, "rows columns"], camera: CaptureCamera) -> _Sums:
    """Of an image that may be smaller than the camera's: pixels of sky."""
    block = np.array([camera.width, camera.height]) / sky.shape[::-1]
    return _Sums(cv2.integral(sky.astype(np.float32)) * block.prod(), block)


@dataclass(frozen=True, eq=False)
class _Poll:
    """What the cameras say of cubes of one size.

    voxels: with all cameras that see them. under_sky: cameras that see nothing but sky behind them, or most of all
    where they are smallest. leaf: which are small enough. solid: which lie inside of an object.
    """

    voxels: Voxels
    under_sky: Bool[np.ndarray, "camera voxel"]
    leaf: Bool[np.ndarray, "voxel"]
    solid: Bool[np.ndarray, "voxel"]


def _polled(
    volume: Volume,
    sums: Sequence[_Sums | None],
    skies: Sequence[_Sums | None],
    centres: Float64[np.ndarray, "voxel 3"],
    half: float,
    config: VoteConfig,
) -> _Poll:
    """The cameras' votes for cubes of one size.

    A large cube's projection is the square around its bounding sphere's and its cameras are those that see all of it,
    so that no part of it could do better. A leaf's is the square around a ball a little larger than the cube's own, so
    that leaves leave no gaps, and its cameras see its centre.
    """
    cameras = volume.cameras
    seen = [seen_by(camera, centres) for camera in cameras]
    around = [np.sqrt(3) * half * one.per_metre for one in seen]
    touched = [one.near_image(camera, r) for one, camera, r in zip(seen, cameras, around, strict=True)]
    scales = np.stack([one.per_metre * touches for one, touches in zip(seen, touched, strict=True)])
    leaf_px = max(config.leaf_px, max(camera.width for camera in cameras) / LEAVES)
    watched = np.maximum(np.count_nonzero(scales, axis=0), 1)
    leaf = 2 * half * scales.sum(axis=0) / watched <= leaf_px
    radius = half * np.where(leaf, LEAF_RADIUS, np.sqrt(3))
    votes, views = np.zeros((len(cameras), len(centres))), np.zeros((len(cameras), len(centres)), bool)
    full, under_sky = np.zeros(len(centres), int), views.copy()
    for index, (one, camera, total, sky) in enumerate(zip(seen, cameras, sums, skies, strict=True)):
        if total is None:
            continue
        reach = radius * one.per_metre
        votes[index], area = _weight_in(total, one.pixels, reach)
        views[index] = one.near_image(camera, np.where(leaf, 0.0, -reach))
        votes[index] *= one.near_image(camera, reach)
        full += views[index] & (votes[index] >= SOLID * area)
        if sky is not None:
            clear, around_it = _weight_in(sky, one.pixels, reach)
            under_sky[index] = views[index] & (clear >= np.where(leaf, 0.5, 1 - 1e-6) * around_it)
    voxels = Voxels(centres, np.full(len(centres), half), votes, views)
    solid = full >= np.maximum(needed_views(views.sum(axis=0), config), 2)
    return _Poll(voxels, under_sky, leaf, solid)


def _weight_in(
    sums: _Sums, pixels: Float64[np.ndarray, "voxel 2"], reach: Float64[np.ndarray, "voxel"]
) -> tuple[Float64[np.ndarray, "voxel"], Float64[np.ndarray, "voxel"]]:
    """Weight in squares about these pixels, pixels, and the squares' areas in the image."""
    total, limits = sums.total, np.array(sums.total.shape[::-1]) - 1.0
    low = np.clip(np.floor((pixels - reach[:, None]) / sums.block), 0, limits).astype(np.intp)
    high = np.clip(np.ceil((pixels + reach[:, None]) / sums.block), 0, limits).astype(np.intp)
    columns, flat = total.shape[1], total.ravel()
    rows_low, rows_high = columns * low[:, 1], columns * high[:, 1]
    weight = flat[rows_high + high[:, 0]] - flat[rows_high + low[:, 0]] - flat[rows_low + high[:, 0]]
    return weight + flat[rows_low + low[:, 0]], np.prod(high - low, axis=1) * sums.block.prod()


def _agreed(poll: _Poll, config: VoteConfig, fewest: int, sky_known: bool) -> tuple[Voxels, Bool[np.ndarray, "voxel"]]:
    """The cubes, and on which enough cameras agree: of those that see one, or of those before whose sky it lies.

    Trees may hide an object from the others. Before a sky three at least must agree, and nothing else counts: leaves
    that move are seen before leaves.
    """
    voxels, seen = poll.voxels, poll.voxels.seen
    agree = voxels.votes >= config.least_px
    enough = agree.sum(axis=0) >= np.maximum(needed_views(seen.sum(axis=0), config), config.views or fewest)
    clear = agree & (poll.under_sky | ~poll.leaf)
    needed = np.maximum(needed_views(poll.under_sky.sum(axis=0), config), FEWEST_VIEWS)
    before_sky = (clear.sum(axis=0) >= needed) & ~enough & sky_known
    counted = np.where(before_sky & poll.leaf, poll.under_sky | agree, seen)
    return Voxels(voxels.centres, voxels.half, voxels.votes, counted), enough | before_sky


def _strongest(voxels: Voxels, most: int) -> Voxels:
    """The voxels with the most votes, then the most weight, where there are too many."""
    if len(voxels.centres) <= most:
        return voxels
    ranks = (voxels.votes > 0).sum(axis=0) + voxels.votes.sum(axis=0) / (voxels.votes.sum() + 1)
    return voxels[np.sort(np.argsort(-ranks, kind="stable")[:most])]


def _joined(parts: Sequence[Voxels]) -> Voxels:
    fields = ((one.centres, one.half) for one in parts)
    centres, half = (np.concatenate(arrays) for arrays in zip(*fields, strict=True))
    votes, seen = (np.concatenate(arrays, axis=1) for arrays in zip(*((p.votes, p.seen) for p in parts), strict=True))
    return Voxels(centres, half, votes, seen)
