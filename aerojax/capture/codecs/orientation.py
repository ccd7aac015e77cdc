"""Orientation tags of JPEG and PNG files: found, and taken out without touching a pixel.

The house reads pixels as they are stored. A file that is given away with such a tag would be shown turned by others,
beside boxes and calibrations of the stored pixels. A tag stands in EXIF (CIPA DC-008, §4.6.5, tag 274) or in XMP.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

_PNG = b"\x89PNG\r\n\x1a\n"
_EXIF, _XMP = b"Exif\0\0", b"http://ns.adobe.com/xap/1.0/\0"
_APP1, _START_OF_SCAN = 0xE1, 0xDA
_ORIENTATION = 274
_WITHOUT_LENGTH = (0x01, *range(0xD0, 0xDA))  # markers that stand alone, ITU T.81 Table B.1

Span = tuple[int, int]
"""First byte of a segment, and the one behind it."""


def has_orientation(path: Path) -> bool:
    """Whether a JPEG or PNG says how to turn it, be it not at all; False for other and for damaged files."""
    with path.open("rb") as file:
        return next(_tagged(file), None) is not None


def without_orientation(path: Path) -> bytes:
    """The bytes of a file without the segments that hold its orientation; pixels stay to the bit."""
    with path.open("rb") as file:
        spans = list(_tagged(file))
    data = path.read_bytes()
    kept, position = b"", 0
    for start, end in spans:
        kept, position = kept + data[position:start], end
    return kept + data[position:]


def _tagged(file: BinaryIO) -> Iterator[Span]:
    start = file.read(len(_PNG))
    try:
        if start.startswith(b"\xff\xd8\xff"):
            yield from _jpeg(file)
        elif start == _PNG:
            yield from _png(file)
    except struct.error:
        return  # cut short; who decodes it will say so


def _jpeg(file: BinaryIO) -> Iterator[Span]:
    position = 2
    while True:
        file.seek(position)
        mark, kind = struct.unpack(">BB", file.read(2))
        if mark != 0xFF or kind == _START_OF_SCAN:
            return
        if kind in _WITHOUT_LENGTH or kind == 0xFF:  # 0xFF fills
            position += 1 if kind == 0xFF else 2
            continue
        (length,) = struct.unpack(">H", file.read(2))
        if kind == _APP1 and _segment_has_it(file.read(max(length - 2, 0))):
            yield position, position + 2 + length
        position += 2 + length


def _segment_has_it(content: bytes) -> bool:
    if content.startswith(_EXIF):
        return _exif_has_it(content[len(_EXIF) :])
    return content.startswith(_XMP) and b":Orientation" in content


def _png(file: BinaryIO) -> Iterator[Span]:
    position = len(_PNG)
    while True:
        file.seek(position)
        length, kind = struct.unpack(">I4s", file.read(8))
        if kind == b"IEND":
            return
        end = position + 12 + length
        if kind == b"eXIf" and _exif_has_it(file.read(length)):
            yield position, end
        elif kind in (b"iTXt", b"tEXt", b"zTXt"):
            content = file.read(length)
            if content.startswith(b"Raw profile type") or b":Orientation" in content:
                yield position, end
        position = end


def _exif_has_it(tiff: bytes) -> bool:
    order = {b"II": "<", b"MM": ">"}.get(tiff[:2])
    if order is None or len(tiff) < 8:
        return False
    (first,) = struct.unpack(order + "I", tiff[4:8])
    (count,) = struct.unpack(order + "H", tiff[first : first + 2])
    entries = (tiff[first + 2 + 12 * i : first + 14 + 12 * i] for i in range(count))
    return any(len(e) == 12 and struct.unpack(order + "H", e[:2])[0] == _ORIENTATION for e in entries)
