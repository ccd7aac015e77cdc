"""PNG files of a small picture in a large constant one, in time that goes with the picture.

A PNG's pixels are one deflate stream. Deflate blocks that refer to nothing before them (a full flush of zlib between
them) may be put together freely, so the constant rows above and below come from a cache and only the picture's rows
are compressed; the stream's Adler-32 is combined from those of its parts. PNG specification, 3rd edition, §9 and §10.
"""

from __future__ import annotations

import functools
import struct
import zlib

import numpy as np
from jaxtyping import UInt8, UInt16

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOUR_TYPE = {1: 0, 3: 2}  # grey and RGB, by number of channels
_FILTER_SUB, _FILTER_UP = b"\x01", 2
_STREAM_START, _STREAM_END = b"\x78\x01", b"\x03\x00"  # zlib header; an empty last block
_ADLER_BASE = 65521

_Part = tuple[bytes, int, int]
"""A piece of the stream: its deflate blocks, and the Adler-32 and length of what they hold."""


def encode_png(
    window: UInt8[np.ndarray, "rows columns channel"] | UInt16[np.ndarray, "rows columns channel"],
    corner: tuple[int, int],
    size: tuple[int, int],
    background: tuple[int, ...],
) -> bytes:
    """A PNG of `size` (width, height) that shows `window` at `corner` (column, row) and `background` elsewhere.

    Args:
        window: grey or RGB, 8 or 16 bits; inside the image. It may be empty.
        corner: of the window's first pixel.
        size: of the image, pixels.
        background: one value a channel.
    """
    (width, height), (rows, _, channels) = size, window.shape
    bits = 8 * window.dtype.itemsize
    constant = _constant_row(width, background, window.dtype.str)
    first = corner[1] if rows else height
    parts = _constant_rows(constant, first)
    if rows:
        parts += [_window_rows(window, corner, width, background), *_constant_rows(constant, height - first - rows)]
    stream, adler = _STREAM_START, 1
    for blocks, checksum, length in parts:
        stream, adler = stream + blocks, _joined_adler(adler, checksum, length)
    stream += _STREAM_END + struct.pack(">I", adler)
    header = struct.pack(">IIBBBBB", width, height, bits, _COLOUR_TYPE[channels], 0, 0, 0)
    return _SIGNATURE + _chunk(b"IHDR", header) + _chunk(b"IDAT", stream) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


@functools.lru_cache(maxsize=64)
def _constant_row(width: int, background: tuple[int, ...], kind: str) -> bytes:
    """A row of one colour with the filter Sub, which makes all such rows the same bytes wherever they stand."""
    pixel = np.array(background, kind).astype(np.dtype(kind).newbyteorder(">")).tobytes()
    return _FILTER_SUB + pixel + bytes((width - 1) * len(pixel))


def _constant_rows(row: bytes, count: int) -> list[_Part]:
    return [_many_rows(row, bit) for bit in range(count.bit_length()) if count >> bit & 1]


@functools.lru_cache(maxsize=256)
def _many_rows(row: bytes, power: int) -> _Part:
    return _part(row * 2**power)


def _window_rows(window: np.ndarray, corner: tuple[int, int], width: int, background: tuple[int, ...]) -> _Part:
    """Rows that cross the window, with the filter Up: what is constant becomes 0, and so does what repeats.

    The row above the first is constant, or there is none and the specification takes it as 0.
    """
    rows, columns, channels = window.shape
    pixels = np.empty((rows + 1, width, channels), window.dtype.newbyteorder(">"))
    pixels[:] = np.array(background, window.dtype)
    pixels[0] *= corner[1] > 0
    pixels[1:, corner[0] : corner[0] + columns] = window
    raw = pixels.view(np.uint8).reshape(rows + 1, -1)
    filtered = np.empty((rows, 1 + raw.shape[1]), np.uint8)
    filtered[:, 0] = _FILTER_UP
    np.subtract(raw[1:], raw[:-1], out=filtered[:, 1:])
    return _part(filtered.tobytes())


def _part(content: bytes) -> _Part:
    # Run lengths suit differences of rows: half the time of a search for repeats, and smaller where there is noise.
    compressor = zlib.compressobj(1, zlib.DEFLATED, -15, 9, zlib.Z_RLE)
    blocks = compressor.compress(content) + compressor.flush(zlib.Z_FULL_FLUSH)
    return blocks, zlib.adler32(content), len(content)


def _joined_adler(first: int, second: int, length: int) -> int:
    """Adler-32 (RFC 1950 §8.2) of two byte strings behind each other, from theirs and the length of the second."""
    low = ((first & 0xFFFF) + (second & 0xFFFF) - 1) % _ADLER_BASE
    high = ((first >> 16) + (second >> 16) + length * ((first & 0xFFFF) - 1)) % _ADLER_BASE
    return high << 16 | low
