"""Float32 TIFF files of one or more channels, in tiles, so that empty parts of an image cost neither time nor space.

OpenCV writes float TIFFs of one channel in full and reads none of two; these files are ordinary TIFF 6.0 (tiles of
§15, deflate of TIFF Technical Note 2) that libtiff-based readers open. Empty tiles all point at the same bytes.

`tifffile` 2026.3.3 reads these files to the same pixels and writes ones that are read here, but it takes whole images
and cannot let tiles share bytes. On a depth image of 2560×1440 with an object of 100×60 pixels it writes 95 kB in
13.5 ms, this module 22 kB in 0.6 ms, and reads that file in 34 ms, this module in 1 ms. So the codec stays our own.
"""

from __future__ import annotations

import functools
import struct
import zlib

import numpy as np
from jaxtyping import Float32

TILE = 128  # pixels; 240 tiles of a 2560×1440 image, of which a distant object touches one
_LEVEL = 1  # surfaces are smooth but their float mantissas are not: higher levels cost much and save little
_SHORT, _LONG = 3, 4
_DEFLATE = (8, 32946)
_SIZES = {_SHORT: 2, _LONG: 4}
_LARGEST = 2**30  # decoded bytes; a forged header claims no more memory than this


class BrokenTiff(Exception):
    """The bytes are no float32 TIFF that this module reads."""


def encode_tiff(
    window: Float32[np.ndarray, "rows columns channel"], corner: tuple[int, int], size: tuple[int, int]
) -> bytes:
    """A TIFF of `size` (width, height) that shows `window` at `corner` (column, row) and 0 elsewhere.

    The time taken goes with the window, not with the image. Nothing depends on when or where it is written.
    """
    (width, height), channels = size, window.shape[2]
    across, down = -(-width // TILE), -(-height // TILE)
    empty = _empty_tile(channels)
    body, offsets, counts = bytearray(empty), [8] * (across * down), [len(empty)] * (across * down)
    (x0, y0), rows, columns = corner, window.shape[0], window.shape[1]
    for j in range(y0 // TILE, -(-(y0 + rows) // TILE) if rows and columns else 0):
        for i in range(x0 // TILE, -(-(x0 + columns) // TILE)):
            tile = zlib.compress(_tile(window, i * TILE - x0, j * TILE - y0), _LEVEL)
            offsets[j * across + i], counts[j * across + i] = 8 + len(body), len(tile)
            body += tile
    body += b"\0" * (len(body) % 2)  # directories begin on a word
    directory = _directory((width, height), channels, offsets, counts, 8 + len(body))
    return struct.pack("<2sHI", b"II", 42, 8 + len(body)) + bytes(body) + directory


def _tile(window: np.ndarray, column: int, row: int) -> bytes:
    """The tile whose first pixel is (column, row) of the window; what lies outside the window is 0."""
    tile = np.zeros((TILE, TILE, window.shape[2]), "<f4")
    top, left = max(row, 0), max(column, 0)
    part = window[top : row + TILE, left : column + TILE]
    tile[top - row : top - row + part.shape[0], left - column : left - column + part.shape[1]] = part
    return tile.tobytes()


@functools.cache
def _empty_tile(channels: int) -> bytes:
    return zlib.compress(bytes(TILE * TILE * 4 * channels), 9)


def _directory(size: tuple[int, int], channels: int, offsets: list[int], counts: list[int], start: int) -> bytes:
    """The image file directory (TIFF 6.0 §2) with the arrays that do not fit into its entries behind it."""
    same = [1] * channels
    fields = [
        (256, _LONG, [size[0]]),
        (257, _LONG, [size[1]]),
        (258, _SHORT, [32] * channels),
        (259, _SHORT, [_DEFLATE[0]]),
        (262, _SHORT, [1]),  # black is zero
        (277, _SHORT, [channels]),
        (284, _SHORT, [1]),  # channels beside each other
        (322, _LONG, [TILE]),
        (323, _LONG, [TILE]),
        (324, _LONG, offsets),
        (325, _LONG, counts),
        *([(338, _SHORT, [0] * (channels - 1))] if channels > 1 else []),  # what the other channels mean is not said
        (339, _SHORT, [3 * one for one in same]),  # floating point
    ]
    behind, entries = b"", b""
    after = start + 2 + 12 * len(fields) + 4
    for tag, kind, values in fields:
        packed = struct.pack(f"<{len(values)}{'H' if kind == _SHORT else 'I'}", *values)
        if len(packed) > 4:
            packed, behind = struct.pack("<I", after + len(behind)), behind + packed + b"\0" * (len(packed) % 2)
        entries += struct.pack("<HHI", tag, kind, len(values)) + packed.ljust(4, b"\0")
    return struct.pack("<H", len(fields)) + entries + b"\0\0\0\0" + behind


def decode_tiff(data: bytes) -> Float32[np.ndarray, "height width channel"]:
    """Pixels of a float32 TIFF in strips or tiles, uncompressed or deflated without predictor, channels interleaved.

    Raises:
        BrokenTiff: the file is cut short, damaged or of another kind; the message says which.
    """
    try:
        return _decode(data)
    except (struct.error, zlib.error, KeyError, IndexError, ValueError, OverflowError):
        raise BrokenTiff("is damaged or cut short") from None


def _decode(data: bytes) -> np.ndarray:
    order = {b"II*\0": "<", b"MM\0*": ">"}[data[:4]]
    tags = _tags(data, order)
    width, height, channels = tags[256][0], tags[257][0], tags.get(277, (1,))[0]
    if set(tags[258]) != {32} or set(tags.get(339, (1,))) != {3}:
        raise BrokenTiff("is not float32")
    compression = tags.get(259, (1,))[0]
    if compression not in (1, *_DEFLATE) or tags.get(317, (1,))[0] != 1 or tags.get(284, (1,))[0] != 1:
        raise BrokenTiff("is stored in a way that is not read here; write it uncompressed")
    tiled = 322 in tags
    across, down = (tags[322][0], tags[323][0]) if tiled else (width, min(tags.get(278, (height,))[0], height))
    offsets, counts = tags[324 if tiled else 273], tags[325 if tiled else 279]
    if min(width, height, channels, across, down) < 1 or 4 * (width + across) * (height + down) * channels > _LARGEST:
        raise BrokenTiff("is of no size that can be read")
    image = np.empty((height, width, channels), np.float32)
    places = [(x, y) for y in range(0, height, down) for x in range(0, width, across)]

    @functools.lru_cache(maxsize=2)  # the empty tile, which most places share, stays beside the latest other one
    def pixels_at(offset: int, count: int, rows: int) -> np.ndarray:
        block = _block(data[offset : offset + count], compression, rows * across * channels * 4)
        return np.frombuffer(block, order + "f4").reshape(rows, across, channels)

    for (x, y), offset, count in zip(places, offsets, counts, strict=True):
        pixels = pixels_at(offset, count, down if tiled else min(down, height - y))
        image[y : y + down, x : x + across] = pixels[: height - y, : width - x]
    return image


def _block(stored: bytes, compression: int, size: int) -> bytes:
    return stored[:size] if compression == 1 else zlib.decompressobj().decompress(stored, size)


def _tags(data: bytes, order: str) -> dict[int, tuple[int, ...]]:
    (start,) = struct.unpack_from(order + "I", data, 4)
    (count,) = struct.unpack_from(order + "H", data, start)
    tags: dict[int, tuple[int, ...]] = {}
    for entry in range(start + 2, start + 2 + 12 * count, 12):
        tag, kind, values = struct.unpack_from(order + "HHI", data, entry)
        if kind in _SIZES:
            place = entry + 8
            if _SIZES[kind] * values > 4:
                (place,) = struct.unpack_from(order + "I", data, place)
            if values > len(data):
                raise BrokenTiff("is damaged or cut short")
            tags[tag] = struct.unpack_from(f"{order}{values}{'H' if kind == _SHORT else 'I'}", data, place)
    return tags
