"""From voxels to objects of one frame: connected voxels, without those that other objects' silhouettes explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from aerojax.capture.format import CaptureCamera
from aerojax.segment.voxel_vote.volume import seen_by
from aerojax.segment.voxel_vote.vote import VoteConfig, Voxels, needed_views

GAP = 1.0
"""Sides of the smaller voxel that may lie between two of one object: rods and wings break up."""
PROJECTED = 1.5
"""Half sides of a voxel that its projection reaches from its centre: nearly the cube's corners."""
MOST_CANDIDATES = 32
"""Groups of voxels that are looked at, those with most votes first."""


@dataclass(frozen=True, eq=False)
class Region:
    """Pixels of one image that an object's voxels project to: those of `inside`, the corner at (column, row)."""

    corner: tuple[int, int]
    inside: Bool[np.ndarray, "rows columns"]

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the image."""
        (x, y), (rows, columns) = self.corner, self.inside.shape
        return slice(y, y + rows), slice(x, x + columns)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A group of voxels that may be an object.

    centre: metres, in the frame of the cameras, weighed by votes. size: largest distance from it, metres.
    regions: where it lies in each image; None where it does not.
    votes: cameras that see it move. watched: cameras that see its place. clear: whether as many as must agree see it by
        pixels that are nobody else's. voxels: how many it has.
    """

    centre: Float64[np.ndarray, "3"]
    size: float
    regions: tuple[Region | None, ...]
    votes: int
    watched: int
    clear: bool
    voxels: int


def candidates(
    voxels: Voxels,
    cameras: Sequence[CaptureCamera],
    weights: Sequence[Float32[np.ndarray, "_ _"] | None],
    config: VoteConfig,
) -> list[Candidate]:
    """The objects of one frame, those that most cameras see first.

    Where two objects fly, rays of the one cross rays of the other at places where nothing is. A group therefore counts
    only if enough cameras see it by pixels that no better group accounts for; one of them may be wrong, because
    objects pass in front of each other.

    Args:
        voxels: from `vote`.
        weights: that they were voted from.
    """
    groups = [part for members in _groups(voxels) for part in _cores(voxels[members], config)]
    groups = sorted(groups, key=_rank, reverse=True)[:MOST_CANDIDATES]
    claimed = [None if weight is None else np.zeros(weight.shape, bool) for weight in weights]
    found = []
    for group in groups:
        regions = tuple(
            None if w is None else region_of(group, camera) for w, camera in zip(weights, cameras, strict=True)
        )
        own = sum(_is_own(r, w, c, config.least_px) for r, w, c in zip(regions, weights, claimed, strict=True))
        watched = _watched(group, config)
        needed = int(needed_views(np.array([watched]), config)[0])
        if own < max(min(2, watched), needed - 1):
            continue
        for region, taken in zip(regions, claimed, strict=True):
            if region is not None and taken is not None:
                taken[region.window] |= region.inside
        found.append(_candidate(group, regions, watched, own >= needed, config))
    return found


def region_of(voxels: Voxels, camera: CaptureCamera) -> Region | None:
    """Where voxels project to in an image: the union of the squares around them; None where that is outside."""
    seen = seen_by(camera, voxels.centres)
    reach = PROJECTED * voxels.half * seen.per_metre
    kept = seen.near_image(camera, reach)
    if not kept.any():
        return None
    limits = np.array([camera.width, camera.height])
    low = np.clip(np.floor(seen.pixels[kept] - reach[kept, None]), 0, limits).astype(int)
    high = np.clip(np.ceil(seen.pixels[kept] + reach[kept, None]), 0, limits).astype(int)
    corner, end = low.min(axis=0), high.max(axis=0)
    columns, rows = end - corner
    # Corners of the squares with signs; their double cumulative sum counts the squares over each pixel.
    edges = np.zeros((rows + 1, columns + 1), np.int32)
    low, high = low - corner, high - corner
    for x, y, sign in ((low, low, 1), (high, high, 1), (low, high, -1), (high, low, -1)):
        np.add.at(edges, (y[:, 1], x[:, 0]), sign)
    inside = edges.cumsum(axis=0).cumsum(axis=1)[:-1, :-1] > 0
    return Region((int(corner[0]), int(corner[1])), inside) if inside.any() else None


def _groups(voxels: Voxels) -> list[Int[np.ndarray, "_"]]:
    """Indices of connected voxels: neighbours, or with a gap of one voxel."""
    count = len(voxels.half)
    if not count:
        return []
    sizes, pairs = np.unique(voxels.half), []
    members = [np.flatnonzero(voxels.half == size) for size in sizes]
    trees = [KDTree(voxels.centres[one]) for one in members]
    for a in range(len(sizes)):
        for b in range(a, len(sizes)):
            near = (sizes[a] + sizes[b]) * 1.01 + 2 * GAP * sizes[a]
            found = trees[a].sparse_distance_matrix(trees[b], near, p=np.inf, output_type="ndarray")
            pairs.append(np.stack([members[a][found["i"]], members[b][found["j"]]]))
    rows, columns = np.concatenate(pairs, axis=1)
    graph = coo_matrix((np.ones(len(rows), bool), (rows, columns)), shape=(count, count))
    number, labels = connected_components(graph, directed=False)
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.cumsum(np.bincount(labels, minlength=number))[:-1])


def _cores(group: Voxels, config: VoteConfig) -> list[Voxels]:
    """Its parts that all but one of the cameras agree on that agree anywhere in it, and that do not touch.

    Where few cameras are needed, the cones of the others reach far from an object, and into those of the next one.
    """
    agreeing = (group.votes >= config.least_px).sum(axis=0)
    core = group[agreeing >= agreeing.max() - 1]
    return [group] if len(core.half) == len(group.half) else [core[members] for members in _groups(core)]


def _watched(group: Voxels, config: VoteConfig) -> int:
    """Cameras that would show it, where most of them agree."""
    agreeing = (group.votes >= config.least_px).sum(axis=0)
    return int(group.seen[:, agreeing == agreeing.max()].any(axis=1).sum())


def _rank(group: Voxels) -> tuple[int, float]:
    """Cameras that vote for one and the same voxel of it, then weight."""
    return int((group.votes > 0).sum(axis=0).max()), float(group.votes.sum())


def _is_own(
    region: Region | None,
    weight: Float32[np.ndarray, "height width"] | None,
    claimed: Bool[np.ndarray, "height width"] | None,
    least: float,
) -> bool:
    """Whether at least half of a camera's weight there is nobody else's."""
    if region is None or weight is None or claimed is None:
        return False
    inside = weight[region.window] * region.inside
    own = float((inside * ~claimed[region.window]).sum())
    return own >= max(least, 0.5 * float(inside.sum()))


def _candidate(
    group: Voxels, regions: tuple[Region | None, ...], watched: int, clear: bool, config: VoteConfig
) -> Candidate:
    votes = group.votes.sum(axis=0)
    centre = votes @ group.centres / votes.sum()
    size = float(np.linalg.norm(group.centres - centre, axis=1).max() + group.half.max())
    best = int((group.votes >= config.least_px).sum(axis=0).max())
    return Candidate(centre, size, regions, best, watched, clear, len(group.half))
