"""Masks of every common format, and what their values mean."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
import pytest

from aerojax.capture.codecs.mask import BrokenMask, decode_mask, is_soft, mask_kind, shares

HEIGHT, WIDTH = 40, 50
INSIDE = np.zeros((HEIGHT, WIDTH), bool)
INSIDE[10:30, 12:37] = True


def png(levels: np.ndarray) -> bytes:
    return cv2.imencode(".png", levels)[1].tobytes()


def jpeg(levels: np.ndarray, quality: int = 80) -> bytes:
    return cv2.imencode(".jpg", levels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def packed_png(indices: np.ndarray, bits: int, palette: list[tuple[int, int, int]] | None) -> bytes:
    """A PNG of 1, 2, 4 or 8 bits a pixel: of a palette, or grey where there is none."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    per_byte = 8 // bits
    padded = np.pad(indices, ((0, 0), (0, -indices.shape[1] % per_byte))).reshape(indices.shape[0], -1, per_byte)
    weights = (2**bits) ** np.arange(per_byte - 1, -1, -1)
    rows = (padded * weights).sum(axis=2).astype(np.uint8)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    height, width = indices.shape
    header = struct.pack(">IIBBBBB", width, height, bits, 0 if palette is None else 3, 0, 0, 0)
    colours = b"" if palette is None else chunk(b"PLTE", bytes(value for colour in palette for value in colour))
    start = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + colours
    return start + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")


def soft_levels(full: int = 255, blur: float = 1.0) -> np.ndarray:
    """A filled ellipse, anti-aliased and blurred."""
    large = np.zeros((8 * HEIGHT, 8 * WIDTH), np.float32)
    cv2.ellipse(large, (200, 160), (120, 70), 20, 0, 360, 1.0, -1)
    small = cv2.GaussianBlur(cv2.resize(large, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), (0, 0), blur)
    return np.round(full * small).astype(np.uint8 if full == 255 else np.uint16)


def two_ids(one: int, other: int, kind: type = np.uint8) -> np.ndarray:
    levels = np.zeros((HEIGHT, WIDTH), kind)
    levels[4:15, 4:15], levels[20:33, 20:40] = one, other
    return levels


RED, GREEN = (128, 0, 0), (0, 128, 0)
IDS = two_ids(1, 2)
READ = {
    "grey of 1 bit": (packed_png(INSIDE.astype(int), 1, None), 255 * INSIDE, "picture"),
    "grey of 2 bits": (packed_png(3 * INSIDE.astype(int), 2, None), 255 * INSIDE, "picture"),
    "grey of 8 bits": (png(np.uint8(255) * INSIDE), 255 * INSIDE, "picture"),
    "grey of 16 bits": (png(np.uint16(65535) * INSIDE), 65535 * INSIDE, "picture"),
    "black and white palette of 1 bit": (
        packed_png(INSIDE.astype(int), 1, [(0, 0, 0), (255, 255, 255)]),
        255 * INSIDE,
        "picture",
    ),
    "palette that begins with white": (
        packed_png(1 - INSIDE.astype(int), 8, [(255, 255, 255), (0, 0, 0)]),
        255 * INSIDE,
        "picture",
    ),
    "palette of colours": (packed_png(IDS.astype(int), 8, [(0, 0, 0), RED, GREEN]), IDS, "ids"),
    "palette of colours in 2 bits": (packed_png(IDS.astype(int), 2, [(0, 0, 0), RED, GREEN]), IDS, "ids"),
    "palette of colours in 4 bits": (packed_png(IDS.astype(int), 4, [(0, 0, 0), RED, GREEN]), IDS, "ids"),
    "palette whose black is last": (
        packed_png(np.where(IDS > 0, IDS - 1, 2).astype(int), 8, [RED, GREEN, (0, 0, 0)]),
        IDS,
        "ids",
    ),
    "grey as RGB": (png(np.repeat(np.uint8(255) * INSIDE[..., None], 3, 2)), 255 * INSIDE, "picture"),
    "ids as RGB": (png(np.repeat(two_ids(1, 7)[..., None], 3, 2)), two_ids(1, 7), "ids"),
    "red as RGB": (png(np.uint8([[[0, 0, 255]]]) * INSIDE[..., None]), 255 * INSIDE, "picture"),
    "opaque RGBA": (
        png(np.dstack([np.repeat(np.uint8(255) * INSIDE[..., None], 3, 2), np.full_like(IDS, 255)])),
        255 * INSIDE,
        "picture",
    ),
    "cut-out RGBA": (
        png(np.dstack([np.full((HEIGHT, WIDTH, 3), 90, np.uint8), np.uint8(255) * INSIDE])),
        255 * INSIDE,
        "picture",
    ),
}


@pytest.mark.parametrize("name", READ)
def test_common_formats_are_read(name):
    data, levels, kind = READ[name]
    read = decode_mask(data)
    np.testing.assert_array_equal(read, levels)
    assert mask_kind(read) == kind and not (kind == "picture" and is_soft(read))


@pytest.mark.parametrize(
    "data",
    [
        png(soft_levels()),
        png(soft_levels(65535)),
        png(soft_levels(blur=2.5)),
        jpeg(soft_levels()),
        jpeg(np.uint8(255) * INSIDE),
        jpeg(np.repeat(np.uint8(255) * INSIDE[..., None], 3, 2)),
        png(np.dstack([np.full((HEIGHT, WIDTH, 3), 90, np.uint8), soft_levels()])),
    ],
    ids=["8 bits", "16 bits", "blurred", "JPEG of shades", "JPEG of two levels", "JPEG in colour", "transparency"],
)
def test_shades_are_coverage(data):
    levels = decode_mask(data)
    assert mask_kind(levels) == "picture" and is_soft(levels)
    share = shares(levels)
    assert share.dtype == np.float32 and share.max() == 1.0
    expected = INSIDE if abs(share.sum() - INSIDE.sum()) < 30 else soft_levels(blur=1.0) > 127
    assert np.count_nonzero((share > 0.5) != expected) < 0.12 * np.count_nonzero(expected)


@pytest.mark.parametrize(
    "levels",
    [
        two_ids(1, 2),
        two_ids(255, 3),
        two_ids(128, 250),
        two_ids(60, 190),
        two_ids(254, 1),
        two_ids(255, 1000, np.uint16),
        two_ids(0, 77),
        np.where(INSIDE, np.repeat(np.arange(1, 6, dtype=np.uint8), 10)[None], 0).astype(np.uint8),
        np.where(INSIDE, np.repeat(np.array([51, 102, 153, 204, 255], np.uint8), 10)[None], 0).astype(np.uint8),
    ],
    ids=lambda levels: "-".join(str(v) for v in np.unique(levels)[1:]),
)
def test_areas_of_one_value_are_ids(levels):
    assert mask_kind(decode_mask(png(levels))) == "ids"


def test_an_empty_mask_says_nothing():
    assert mask_kind(decode_mask(png(np.zeros((HEIGHT, WIDTH), np.uint8)))) is None


def test_colours_without_a_palette_are_refused():
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    image[2:9, 2:9, 0], image[12:20, 12:20, 1] = 255, 255
    with pytest.raises(BrokenMask) as refused:
        decode_mask(png(image))
    assert "several colours" in refused.value.problem and not refused.value.damaged


@pytest.mark.parametrize("keep", [0, 10, 60])
def test_damaged_masks_say_so(keep):
    with pytest.raises(BrokenMask) as refused:
        decode_mask(packed_png(IDS.astype(int), 8, [(0, 0, 0), RED, GREEN])[:keep])
    assert refused.value.damaged
