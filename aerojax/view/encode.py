"""Images as short text: data URIs, outlines of masks as SVG paths."""

from __future__ import annotations

import base64
from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

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
    return data_uri(bgr, "jpeg", [cv2.IMWRITE_JPEG_QUALITY, quality])


def data_uri(bgr: UInt8[np.ndarray, "height width channel"], kind: str, settings: list[int]) -> str:
    """An image in OpenCV's order of channels, encoded as `kind` ("jpeg", "png", "webp") with OpenCV's settings."""
    data = cv2.imencode(f".{kind}", bgr, settings)[1].tobytes()
    return f"data:image/{kind};base64," + base64.b64encode(data).decode("ascii")


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
