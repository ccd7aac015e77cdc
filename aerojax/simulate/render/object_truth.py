"""The truth of one image that follows from its rays: mask values, depth, boxes, visibility and centroids."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, UInt16

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import Box
from aerojax.simulate.render.image import ObjectView, Window
from kernels.rays.raytrace import Hits


def bounds(pixels: Int[np.ndarray, "pixel"], width: int) -> Window:
    """The smallest window of pixels (row·width + column)."""
    rows, columns = pixels // width, pixels % width
    return (int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1)


def instance_ids(hits: Hits, visible: Float[np.ndarray, "pixel"], threshold: float) -> UInt16[np.ndarray, "pixel"]:
    """Mask values, 1 for the first object: the one with most samples where coverage reaches the threshold, else 0."""
    return np.where(visible >= threshold - 1e-9, hits.winner + 1, 0).astype(np.uint16)


def surface_depth(hits: Hits, mask: UInt16[np.ndarray, "pixel"]) -> Float[np.ndarray, "pixel"]:
    """Depth at the pixels' centres, metres; of mask pixels whose centre misses, the mean of their samples."""
    rows = np.flatnonzero((mask > 0) & (hits.depth == 0))
    winner = hits.winner[rows]
    depth = hits.depth.copy()
    depth[rows] = hits.depths[rows, winner] / hits.visible[rows, winner]
    return depth


def object_view(
    index: int,
    box: Box | None,
    hits: Hits | None,
    mask: UInt16[np.ndarray, "pixel"],
    origin: Float[np.ndarray, "3"],
    camera: CaptureCamera,
) -> ObjectView:
    """What an image shows of one object.

    Args:
        index: of the object; its value in the mask is `index` + 1.
        box: of its projected vertices.
        hits: None where no ray was cast.
        mask: of the hits' pixels.
        origin: of the object's frame, metres, world.
        camera: of the image.
    """
    outside = box is None or _reaches_out(box, camera)
    if hits is None:
        return ObjectView(index + 1, None, None, box, 0.0, outside, None)
    mine = hits.pixels[mask == index + 1]
    tight = None
    if len(mine):
        x0, y0, x1, y1 = bounds(mine, camera.width)
        tight = (float(x0), float(y0), float(x1), float(y1))
    share = hits.visible[:, index] / hits.rays
    alone, total = float((hits.alone[:, index] / hits.rays).sum()), float(share.sum())
    centroid = None
    if total > 0:
        mean = (hits.points[:, index] / hits.rays[:, None]).sum(axis=0, dtype=np.float64) / total + origin
        centroid = (float(mean[0]), float(mean[1]), float(mean[2]))
    visibility, seen = total / alone if alone > 0 else 0.0, _visible_box(hits, index, camera.width)
    return ObjectView(index + 1, tight, seen, box, visibility, outside, centroid)


def _reaches_out(box: Box, camera: CaptureCamera) -> bool:
    return box[0] < 0 or box[1] < 0 or box[2] > camera.width or box[3] > camera.height


def _visible_box(hits: Hits, index: int, width: int) -> Box | None:
    seen = hits.visible[:, index] > 0
    if not seen.any():
        return None
    rows, columns = np.divmod(hits.pixels[seen], width)
    part = hits.reach[seen, index].astype(np.float64)
    low = (columns + part[:, 0]).min(), (rows + part[:, 1]).min()
    high = (columns + part[:, 2]).max(), (rows + part[:, 3]).max()
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
