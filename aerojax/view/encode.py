"""Images and clouds as short text: JPEG data URIs, outlines as SVG paths, points as 16-bit numbers."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

JPEG_LEVELS = ((256, 82), (192, 78), (128, 72), (96, 62), (64, 50), (48, 40))
"""Longest side in pixels and JPEG quality, tried in this order until the images fit their share of the page."""

_MOST_PARTS = 32
"""Borders drawn of one mask: an object behind a fence has fewer, a mask of noise has thousands."""


def jpeg_uri(rgb: UInt8[np.ndarray, "height width 3"], side: int, quality: int) -> str:
    """An image as a JPEG data URI, shrunk to at most `side` pixels on its longer side, never enlarged."""
    shrink = min(1.0, side / max(rgb.shape[:2]))
    if shrink < 1:
        size = max(1, round(rgb.shape[1] * shrink)), max(1, round(rgb.shape[0] * shrink))
        rgb = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    bgr = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2BGR)
    data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
    return "data:image/jpeg;base64," + base64.b64encode(data).decode("ascii")


def jpegs_within(images: Sequence[np.ndarray], budget: int) -> list[str]:
    """All images at the best level of `JPEG_LEVELS` whose sum is at most `budget` characters.

    The last level is used where none fits, so that the caller has to bound the number of images.
    """
    encoded: list[str] = []
    for side, quality in JPEG_LEVELS:
        encoded = [jpeg_uri(image, side, quality) for image in images]
        if sum(map(len, encoded)) <= budget:
            break
    return encoded


def mask_outline(mask: Bool[np.ndarray, "height width"], most: int = 4000) -> str:
    """The borders of a mask as an SVG path in the crop's pixels; empty for an empty mask.

    A path longer than `most` characters (a mask full of specks) is drawn more coarsely, and what still does not fit
    is left out, the smallest parts first.
    """
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    contours = sorted(contours, key=cv2.contourArea, reverse=True)[:_MOST_PARTS]
    parts: list[str] = []
    for tolerance in (0.6, 1.5, 4.0):
        parts = [_closed_path(cv2.approxPolyDP(contour, tolerance, True)[:, 0]) for contour in contours]
        if sum(map(len, parts)) <= most:
            return "".join(parts)
    path = ""
    for part in parts:
        path += part if len(path) + len(part) <= most else ""
    return path


def _closed_path(corners: np.ndarray) -> str:
    if len(corners) < 2:
        return ""
    return "M" + "L".join(f"{x + 0.5:g} {y + 0.5:g}" for x, y in corners.tolist()) + "Z"


def mask_box(mask: Bool[np.ndarray, "height width"]) -> list[int] | None:
    """x0, y0, x1, y1 of a mask, ends exclusive; None for an empty mask."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if rows.size == 0:
        return None
    return [int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1]


def cloud_radius(clouds: Sequence[np.ndarray]) -> float:
    """Half the side, metres, of a cube about each cloud's median that holds 99 % of the points along every axis."""
    reach = [np.quantile(np.abs(c - np.median(c, axis=0)), 0.99, axis=0).max() for c in map(_finite, clouds) if len(c)]
    return max(1e-3, 1.15 * float(max(reach, default=1.0)))


def _finite(points: np.ndarray) -> np.ndarray:
    return points[np.isfinite(points).all(axis=1)]


def pack_cloud(
    points: Float32[np.ndarray, "point 3"], colours: UInt8[np.ndarray, "point 3"], radius: float, most: int
) -> dict[str, Any]:
    """A cloud for the page's script, about its own median and thinned evenly to `most` points.

    Returns:
        `xyz`: base64 of little-endian int16, 32767 = `radius`; `rgb`: base64 of bytes; `count`: points before
        thinning; points that are not finite or lie outside the cube are left out.
    """
    finite = np.isfinite(points).all(axis=1)
    count, points, colours = len(points), points[finite], colours[finite]
    centred = points - (np.median(points, axis=0) if len(points) else np.float32(0))
    inside = (np.abs(centred) <= radius).all(axis=1)
    centred, colours = centred[inside], colours[inside]
    if len(centred) > most:
        chosen = np.linspace(0, len(centred) - 1, most).round().astype(int)
        centred, colours = centred[chosen], colours[chosen]
    quantised = np.round(centred / radius * 32767).astype("<i2")
    xyz, rgb = (base64.b64encode(a.tobytes()).decode("ascii") for a in (quantised, np.ascontiguousarray(colours)))
    return {"xyz": xyz, "rgb": rgb, "count": count}
