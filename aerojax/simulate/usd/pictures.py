"""Decode pictures of models, PNG and JPEG among them, whose declared size is believed only up to a bound."""

from __future__ import annotations

import struct

import cv2
import numpy as np

from aerojax.core.errors import UserError

MOST_PIXELS = 2**26
"""8192 × 8192; decoded as RGBA such a picture takes 268 MB, whatever few bytes it is packed in."""


def decode_picture(data: bytes, source: str, flags: int) -> np.ndarray:
    """Decode with OpenCV.

    Args:
        data: the file's bytes.
        source: what messages call it.
        flags: OpenCV's `IMREAD_…`.

    Raises:
        UserError: it is no picture, is damaged, or declares more than `MOST_PIXELS`.
    """
    declared = _declared_pixels(data)
    if declared > MOST_PIXELS:
        raise UserError("out-of-range", f"{source}: a picture of {declared} pixels", f"use at most {MOST_PIXELS}")
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    except cv2.error:
        picture = None
    if picture is None:
        raise UserError("unreadable", f"{source} is not a readable PNG or JPEG picture", "save it as one of them")
    return picture


def _declared_pixels(data: bytes) -> int:
    """Width times height as a PNG or JPEG header says; 0 for others, which OpenCV bounds by itself."""
    if data.startswith(b"\x89PNG") and len(data) >= 24:
        width, height = struct.unpack(">II", data[16:24])
        return width * height
    at = 2 if data.startswith(b"\xff\xd8") else len(data)
    while at + 9 <= len(data):
        marker, kind, length, _, height, width = struct.unpack(">BBHBHH", data[at : at + 9])
        if marker != 0xFF:
            return 0
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):  # start of frame, ITU T.81 Table B.1
            return width * height
        at += 2 + length
    return 0
