"""Masks as other tools store them, and one rule for what their values mean.

How the pixels become levels: grey images of any depth as they are; colours that are grey, or shades of one colour, by
their largest channel; transparency that varies, by itself; palettes of colours by index, black being the background.

What the levels mean: **ids**, where a value is the number of an instance, or **a picture** of one object. It is a
picture if its only value beside 0 is the largest (255 or 65535), or if it shades from 0 to about the largest as
anti-aliasing, blur and JPEG do: between them, many values, none of which fills an area. Everything else is ids.
"""

from __future__ import annotations

import struct
import zlib
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Integer, Shaped, UInt8, UInt16

MaskKind = Literal["ids", "picture"]
Levels = UInt8[np.ndarray, "height width"] | UInt16[np.ndarray, "height width"]

_PNG = b"\x89PNG\r\n\x1a\n"
_IHDR_END = 33  # signature, length, kind, 13 bytes and a checksum
_GREY, _PALETTE = 0, 3  # PNG colour types, §11.2.1
_GREY_COLOUR = 8
"""Channels of a grey pixel may be this far apart: JPEG rounds its colour differences."""
_NOISE, _FULL = 0.05, 0.95
"""Shares below and above are 0 and 1: ringing of JPEG is a few hundredths."""
_FEWEST_NOISE = 4
"""Different values near 0 that are noise beside a full area; fewer are small ids."""
_FEWEST_SHADES, _FEWEST_SHADES_WITHOUT_FULL = 3, 8
"""Values between 0 and full of a shaded picture; without a full pixel nothing but their number tells them from ids."""
_MOST_FLAT = 0.1
"""Share of the pixels between that equal all their neighbours; of instances of 5×5 pixels it is 0.36."""


class BrokenMask(Exception):
    """A file is no image, or its colours cannot be told apart as instances.

    problem, remedy: what is wrong with the file, which they do not name, and what to do about it.
    damaged: the file cannot be decoded; otherwise it says what cannot be used, and so do its neighbours.
    """

    def __init__(self, problem: str, remedy: str, *, damaged: bool = False) -> None:
        super().__init__(problem, remedy)
        self.problem, self.remedy, self.damaged = problem, remedy, damaged


def decode_mask(data: bytes) -> Levels:
    """The levels of a mask file: PNG of any colour type and depth, JPEG or TIFF.

    Raises:
        BrokenMask: the file is damaged, has floats, or several colours without a palette.
    """
    palette = _palette(data)
    if palette is not None and not _is_grey(palette):
        return _indices(data, palette)
    image = _decoded(data)
    if image.dtype not in (np.uint8, np.uint16):
        raise BrokenMask(f"has {image.dtype} values", "write the mask as a grey 8- or 16-bit PNG")
    if image.ndim == 2:
        return image
    if image.shape[2] in (2, 4):
        alpha = image[..., -1]
        if alpha.min() != alpha.max():
            return alpha
        image = image[..., :-1]
    return _one_colour(image)


def _decoded(data: bytes) -> Shaped[np.ndarray, "height width *channel"]:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    except cv2.error:
        image = None
    if image is None:
        raise BrokenMask("the image is damaged or cut short", "write or copy it again", damaged=True)
    return image


def _one_colour(image: Integer[np.ndarray, "height width channel"]) -> Levels:
    """The largest channel of a grey image or of shades of one colour."""
    levels = np.ascontiguousarray(image.max(axis=2))
    scale = 1 if image.dtype == np.uint8 else 257
    if int((levels - image.min(axis=2)).max(initial=0)) <= _GREY_COLOUR * scale:
        return levels
    strong = image[levels > levels.max() // 2].astype(np.float64)
    hue = strong / strong.max(axis=1, keepdims=True)
    if np.ptp(hue, axis=0).max() > 0.2:  # shades of one colour keep the ratios of its channels
        raise BrokenMask(
            "has several colours, which are no instance ids", "write ids as a grey 16-bit PNG, or one with a palette"
        )
    return levels


def _palette(data: bytes) -> UInt8[np.ndarray, "entry 3"] | None:
    """The colours of a PNG with a palette; None for other files."""
    if not data.startswith(_PNG) or len(data) < _IHDR_END or data[25] != _PALETTE:
        return None
    position = _IHDR_END
    while position + 8 <= len(data):
        length, kind = struct.unpack(">I4s", data[position : position + 8])
        if kind == b"PLTE":
            colours = np.frombuffer(data[position + 8 : position + 8 + length], np.uint8)
            return colours[: len(colours) // 3 * 3].reshape(-1, 3)
        position += 12 + length
    return None


def _is_grey(colours: UInt8[np.ndarray, "entry 3"]) -> bool:
    return bool((colours == colours[:, :1]).all())


def _indices(data: bytes, palette: UInt8[np.ndarray, "entry 3"]) -> UInt16[np.ndarray, "height width"]:
    """Indices of a palette's colours as ids; where entry 0 is not black, they count from 1 and black is 0."""
    bits = data[24]
    # The same pixels as a grey image; OpenCV stretches those of fewer than 8 bits to 0..255.
    header = data[12:25] + bytes([_GREY]) + data[26:29]
    grey = data[:12] + header + struct.pack(">I", zlib.crc32(header)) + data[_IHDR_END:]
    indices = _decoded(grey).astype(np.uint16)
    if bits < 8:
        indices //= np.uint16(255 // (2**bits - 1))
    black = (palette == 0).all(axis=1)
    if len(black) and black[0]:
        return indices
    numbers = np.arange(1, 257, dtype=np.uint16)
    numbers[: len(black)][black] = 0
    return numbers[indices]


def mask_kind(levels: Levels) -> MaskKind | None:
    """What the levels of one image mean; None where they are all 0."""
    top = int(levels.max(initial=0))
    if top == 0:
        return None
    between = _between(levels)
    full = int(np.iinfo(levels.dtype).max)
    if not between.any():
        return "picture" if _is_black_and_white(_values(levels), full) else "ids"
    return "picture" if _is_shaded(levels, between, reaches_full=top >= _FULL * full) else "ids"


def _values(levels: Integer[np.ndarray, "..."]) -> Integer[np.ndarray, "value"]:
    return np.flatnonzero(np.bincount(levels.ravel()))  # many times as fast as sorting, which `np.unique` does


def _is_black_and_white(values: Integer[np.ndarray, "value"], full: int) -> bool:
    """Whether values near 0 and near full alone are 0 and full, whatever JPEG made of them, rather than ids."""
    low, high = values[(values > 0) & (values <= full // 2)], values[values > full // 2]
    if not len(high):
        return False
    return len(low) >= _FEWEST_NOISE if len(low) else len(high) > 1 or int(high[0]) == full


def _between(levels: Levels) -> Bool[np.ndarray, "height width"]:
    full = float(np.iinfo(levels.dtype).max)
    return (levels > _NOISE * full) & (levels < _FULL * full)


def _is_shaded(levels: Levels, between: Bool[np.ndarray, "height width"], *, reaches_full: bool) -> bool:
    fewest = _FEWEST_SHADES if reaches_full else _FEWEST_SHADES_WITHOUT_FULL
    if levels.max() <= np.iinfo(levels.dtype).max // 2 or len(_values(levels[between])) < fewest:
        return False
    padded = np.pad(levels, 1)
    middle = padded[1:-1, 1:-1]
    beside = (padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:])
    flat = between & np.logical_and.reduce([one == middle for one in beside])
    return bool(np.count_nonzero(flat) < _MOST_FLAT * np.count_nonzero(between))


def is_soft(levels: Levels) -> bool:
    """Whether a picture shades between 0 and full."""
    return bool(_between(levels).any())


def shares(levels: Levels) -> Float32[np.ndarray, "height width"]:
    """Levels of a picture as shares of pixels, 0..1."""
    share = levels.astype(np.float32) / np.float32(np.iinfo(levels.dtype).max)
    share[share < _NOISE] = 0
    share[share > _FULL] = 1
    return share
