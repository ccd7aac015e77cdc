"""What the images of a sequence show of its objects, measured on the files and set beside the truth."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from aerojax.capture.format import Capture, CaptureCamera, ObjectState, TrackedObject, read_capture
from aerojax.capture.frames import read_coverage, read_depth, read_mask
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.manifest import SequenceEntry
from aerojax.evaluate.dataset_qa.boxes import NOWHERE, subpixel_box
from aerojax.geometry.boxes import tight_box
from aerojax.geometry.cameras import project_points

_MARGIN = 2  # pixels around the projected box that are looked at for coverage; rounding needs one


@dataclass(frozen=True, eq=False)
class Observations:
    """One row for every object, frame and camera; a value that does not exist is NaN.

    sequence: index into the list of sequences. tracked: index of the object in its sequence. label: into `CLASSES`.
    frame, camera: indices. size: of the image, width and height.
    distance: from the camera's centre to the body's origin, metres. focal: pixels.
    truncated, visibility, projected_box: of the truth.
    area: pixels of the mask on disk; covered: area with the shares of pixels, from the coverage image.
    mask_box: tight box of the mask on disk. covered_box: sub-pixel box of what is visible, from the truth where it is
        told, else from the coverage image.
    centroid: mean of the silhouette's pixels by coverage (of the mask's pixels where there is no coverage image).
    depth_centroid: the same with each pixel weighted by its depth besides.
    surface_pixel, origin_pixel: projections of the truth's `surface_centroid` and of the body's origin.
    position: the body's origin, metres, world.
    """

    sequence: Int[np.ndarray, "view"]
    tracked: Int[np.ndarray, "view"]
    label: Int[np.ndarray, "view"]
    frame: Int[np.ndarray, "view"]
    camera: Int[np.ndarray, "view"]
    size: Float[np.ndarray, "view 2"]
    distance: Float[np.ndarray, "view"]
    focal: Float[np.ndarray, "view"]
    truncated: Bool[np.ndarray, "view"]
    visibility: Float[np.ndarray, "view"]
    area: Float[np.ndarray, "view"]
    covered: Float[np.ndarray, "view"]
    projected_box: Float[np.ndarray, "view 4"]
    mask_box: Float[np.ndarray, "view 4"]
    covered_box: Float[np.ndarray, "view 4"]
    centroid: Float[np.ndarray, "view 2"]
    depth_centroid: Float[np.ndarray, "view 2"]
    surface_pixel: Float[np.ndarray, "view 2"]
    origin_pixel: Float[np.ndarray, "view 2"]
    position: Float[np.ndarray, "view 3"]

    @property
    def in_view(self) -> Bool[np.ndarray, "view"]:
        """Whether the mask has a pixel of the object."""
        return self.area > 0

    def where(self, chosen: Bool[np.ndarray, "view"]) -> Observations:
        """Only the chosen rows."""
        return Observations(**{f.name: getattr(self, f.name)[chosen] for f in dataclasses.fields(self)})


def joined(parts: Sequence[Observations]) -> Observations:
    """All rows of several, at least one."""
    names = [field.name for field in dataclasses.fields(Observations)]
    return Observations(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def observe_sequence(entry: SequenceEntry, index: int, *, depth: bool = False) -> Observations:
    """Measure every image of a sequence.

    Args:
        entry: which sequence; its true cameras are used where the written calibration is wrong on purpose.
        index: becomes the column `sequence`.
        depth: read depth images too, for `depth_centroid`.

    Raises:
        UserError: the capture is damaged, or has no truth or no masks.
    """
    capture = read_capture(entry.folder)
    if capture.truth is None or any(camera.mask is None for camera in capture.cameras):
        raise UserError(
            "missing", f"{entry.folder}: has no truth or no masks", "only generated sequences can be described"
        )
    cameras = _true_cameras(capture, entry)
    rows: list[dict[str, Any]] = []
    for frame in range(capture.frames):
        for number in range(len(cameras)):
            rows += _observe(capture, cameras[number], number, frame, depth)
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return Observations(sequence=np.full(len(rows), index), **columns)


def _true_cameras(capture: Capture, entry: SequenceEntry) -> tuple[CaptureCamera, ...]:
    true = {camera.name: camera for camera in entry.true_cameras}
    return tuple(
        dataclasses.replace(c, K=true[c.name].K, world_from_cam=true[c.name].world_from_cam) if c.name in true else c
        for c in capture.cameras
    )


def _observe(capture: Capture, camera: CaptureCamera, number: int, frame: int, depth: bool) -> list[dict[str, Any]]:
    """Rows of all objects in one image; none where the camera was not recording."""
    mask = read_mask(capture, number, frame)
    if mask is None or capture.truth is None:
        return []
    coverage = read_coverage(capture, number, frame)
    z = read_depth(capture, number, frame) if depth else None
    objects = [(t, item, state) for t, item in enumerate(capture.truth.objects) if (state := _state(item, frame))]
    boxes = {t: state.projected_box.get(camera.name, NOWHERE) for t, _, state in objects}
    rows = []
    for tracked, item, state in objects:
        others = [box for t, box in boxes.items() if t != tracked]
        truth = _told(state, camera) | {"tracked": tracked, "label": CLASSES.index(item.class_name)}
        seen = _measured(mask, coverage, z, item.object_id, boxes[tracked], others)
        if camera.name in state.visible_box:
            seen["covered_box"] = np.array(state.visible_box[camera.name])
        rows.append({"frame": frame, "camera": number, **truth, **seen})
    return rows


def _state(item: TrackedObject, frame: int) -> ObjectState | None:
    if frame < len(item.frames) and item.frames[frame].frame == frame:
        return item.frames[frame]
    return next((state for state in item.frames if state.frame == frame), None)


def _told(state: ObjectState, camera: CaptureCamera) -> dict[str, Any]:
    """What the truth says about one object in one image."""
    name, position = camera.name, np.array(state.position)
    nowhere = (np.nan, np.nan, np.nan)
    return {
        "size": (float(camera.width), float(camera.height)),
        "distance": float(np.linalg.norm(position - camera.world_from_cam[:3, 3])),
        "focal": float(camera.K[0, 0]),
        "truncated": bool(state.truncated.get(name, False)),
        "visibility": float(state.visibility.get(name, np.nan)),
        "projected_box": np.array(state.projected_box.get(name, NOWHERE)),
        "surface_pixel": project_points(np.array(state.surface_centroid.get(name, nowhere)), camera, behind=np.nan),
        "origin_pixel": project_points(position, camera, behind=np.nan),
        "position": position,
    }


def _measured(
    mask: np.ndarray,
    coverage: np.ndarray | None,
    depth: np.ndarray | None,
    object_id: int,
    box: tuple[float, ...] | np.ndarray,
    others: list[Any],
) -> dict[str, Any]:
    """What the images say about one object."""
    mine = mask == object_id
    around = np.array(tight_box(mine) or NOWHERE)
    window = _window(around, np.array(box), mask.shape)
    part = mine[window]
    share = part.astype(np.float64) if coverage is None else _own_coverage(mask[window], part, coverage[window])
    for other in others if coverage is not None else ():
        rival = _window(np.array(other), np.array(other), mask.shape)
        share = _without_fringe(share, part, window, rival)
    corner = np.array([window[1].start, window[0].start], np.float64)
    centroid, deep = _centroids(share, None if depth is None else depth[window], corner)
    return {
        "area": float(part.sum()),
        "covered": float(share.sum()) if coverage is not None else np.nan,
        "mask_box": around,
        "covered_box": subpixel_box(share) + np.tile(corner, 2) if coverage is not None else np.array(NOWHERE),
        "centroid": centroid,
        "depth_centroid": deep,
    }


def _window(one: np.ndarray, other: np.ndarray, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Whole pixels around two boxes, with a margin, inside the image; empty where neither exists."""
    known = np.array([box for box in (one, other) if np.isfinite(box).all()])
    if not len(known):
        return slice(0, 0), slice(0, 0)
    x0, y0 = (np.floor(known[:, :2].min(axis=0)) - _MARGIN).clip(0).astype(int)
    x1, y1 = np.minimum(np.ceil(known[:, 2:].max(axis=0)) + _MARGIN, [shape[1], shape[0]]).astype(int)
    return slice(y0, max(y1, y0)), slice(x0, max(x1, x0))


def _own_coverage(ids: np.ndarray, mine: np.ndarray, coverage: np.ndarray) -> np.ndarray:
    """Coverage of the object's pixels and of those on its edge that are covered too little for the mask."""
    return np.where(mine | (ids == 0), coverage, 0.0).astype(np.float64)


def _without_fringe(
    share: np.ndarray, mine: np.ndarray, window: tuple[slice, slice], rival: tuple[slice, slice]
) -> np.ndarray:
    """Edge pixels inside another object's window may be that one's, so they are left out."""
    rows, columns = (
        slice(max(r.start - w.start, 0), max(r.stop - w.start, 0)) for w, r in zip(window, rival, strict=True)
    )
    share = share.copy()
    share[rows, columns] = np.where(mine[rows, columns], share[rows, columns], 0.0)
    return share


def _centroids(
    share: np.ndarray, depth: np.ndarray | None, corner: np.ndarray
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Mean pixel by coverage, and by coverage and depth; pixels of the edge without depth have the mean depth."""
    middle = _mean_pixel(share, corner)
    if depth is None or not (depth > 0).any():
        return middle, np.full(2, np.nan)
    return middle, _mean_pixel(share * np.where(depth > 0, depth, depth[depth > 0].mean()), corner)


def _mean_pixel(weight: np.ndarray, corner: np.ndarray) -> Float[np.ndarray, "2"]:
    total = weight.sum()
    if not total > 0:
        return np.full(2, np.nan)
    x = weight.sum(axis=0) @ (np.arange(weight.shape[1]) + 0.5)
    y = weight.sum(axis=1) @ (np.arange(weight.shape[0]) + 0.5)
    return corner + np.array([x, y]) / total
