"""Image sizes from file headers, so that validation reads a few bytes a file instead of decoding it."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG_END = b"\xff\xd9"
_TAIL = 4096
"""Bytes behind the end of an image that some cameras append to it."""
_PNG_END = b"IEND\xae\x42\x60\x82"
_TIFF_WIDTH, _TIFF_HEIGHT, _TIFF_BITS, _TIFF_CHANNELS, _TIFF_FORMAT = 256, 257, 258, 277, 339


@dataclass(frozen=True)
class ImageHeader:
    """What a header says: size in pixels, channels (0 = unknown), bits a channel and whether values are floats."""

    width: int
    height: int
    channels: int
    bits: int
    floating: bool = False


class BrokenImage(Exception):
    """A file is no PNG, JPEG or TIFF, or stops too early."""


def read_header(path: Path) -> ImageHeader:
    """Read the header of a PNG, JPEG or TIFF file.

    Raises:
        BrokenImage: the file is empty, cut short (as far as its ends show) or of another format.
    """
    try:
        with path.open("rb") as file:
            start = file.read(26)
            if start.startswith(_PNG):
                return _png(start, file)
            if start.startswith(b"\xff\xd8\xff"):
                return _jpeg(file)
            if start[:4] in (b"II*\0", b"MM\0*"):
                return _tiff(start, file)
    except (struct.error, IndexError, OSError):
        raise BrokenImage("is cut short or cannot be read") from None
    raise BrokenImage("is cut short or not a PNG, JPEG or TIFF image" if start else "is an empty file")


def _png(start: bytes, file: BinaryIO) -> ImageHeader:
    kind, width, height, bits, colour = struct.unpack(">4sIIBB", start[12:26])
    if kind != b"IHDR":
        raise BrokenImage("is a PNG without a header chunk")
    file.seek(-min(64, file.seek(0, 2)), 2)  # some writers append a few bytes to the end chunk
    if _PNG_END not in file.read():
        raise BrokenImage("is a PNG that was cut short")
    return ImageHeader(width, height, {0: 1, 2: 3, 3: 3, 4: 2, 6: 4}.get(colour, 0), bits)


def _jpeg(file: BinaryIO) -> ImageHeader:
    position = 2
    while True:
        file.seek(position)
        marker, kind, length = struct.unpack(">BBH", file.read(4))
        if marker != 0xFF:
            raise BrokenImage("is a damaged JPEG")
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):  # start of frame, ITU T.81 Table B.1
            bits, height, width, channels = struct.unpack(">BHHB", file.read(6))
            if not _has_end(file, _JPEG_END):
                raise BrokenImage("is a JPEG that was cut short")
            return ImageHeader(width, height, channels, bits)
        position += 2 + length


def _has_end(file: BinaryIO, end: bytes) -> bool:
    """Whether `end` stands among a file's last bytes; where these are something else's, whether it stands anywhere."""
    file.seek(-min(_TAIL, file.seek(0, 2)), 2)
    if end in file.read():
        return True
    file.seek(0)
    return end in file.read()


def _tiff(start: bytes, file: BinaryIO) -> ImageHeader:
    order = "<" if start[:2] == b"II" else ">"
    file.seek(struct.unpack(order + "I", start[4:8])[0])
    (count,) = struct.unpack(order + "H", file.read(2))
    tags = {_TIFF_BITS: 1, _TIFF_CHANNELS: 1, _TIFF_FORMAT: 1}
    for _ in range(count):
        entry = file.read(12)
        tag, kind, values = struct.unpack(order + "HHI", entry[:8])
        if (kind, values) in ((3, 1), (3, 2), (4, 1)):  # SHORTs or a LONG stored in place, TIFF 6.0 §2
            # Two channels have two bit depths; all readers in use want them equal, so the first speaks for both.
            (tags[tag],) = struct.unpack(order + ("H" if kind == 3 else "I"), entry[8 : 10 if kind == 3 else 12])
    if _TIFF_WIDTH not in tags or _TIFF_HEIGHT not in tags:
        raise BrokenImage("is a TIFF without a size")
    sizes = tags[_TIFF_WIDTH], tags[_TIFF_HEIGHT], tags[_TIFF_CHANNELS], tags[_TIFF_BITS]
    return ImageHeader(*sizes, floating=tags[_TIFF_FORMAT] == 3)
