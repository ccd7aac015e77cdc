"""Windows of frames: the files are the same pixels that a whole image gives, to any reader."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
import pytest
from support.broken_captures import HEIGHT, WIDTH, make_camera

from aerojax.capture.codecs.png import encode_png
from aerojax.capture.format import Capture
from aerojax.capture.frames import read_coverage, read_depth, read_flow, read_mask, read_normal, read_rgb
from aerojax.capture.write import FrameExtras, Placement, write_frame
from aerojax.core.errors import UserError

PLACES = [  # size, window's shape, its corner
    ((300, 200), (90, 120), (37, 51)),
    ((300, 200), (1, 1), (299, 199)),
    ((300, 200), (2, 300), (0, 0)),
    ((300, 200), (0, 0), (0, 0)),
    ((33, 70), (70, 33), (0, 0)),
    ((1, 1), (1, 1), (0, 0)),
]


def whole(window, corner, size, background):
    image = np.empty((size[1], size[0], window.shape[2]), window.dtype)
    image[:] = np.array(background, window.dtype)
    image[corner[1] : corner[1] + window.shape[0], corner[0] : corner[0] + window.shape[1]] = window
    return image


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize(("size", "shape", "corner"), PLACES)
def test_png_of_a_window_decodes_to_the_whole_image(size, shape, corner, kind, channels):
    rng = np.random.default_rng(3)
    window = rng.integers(0, np.iinfo(kind).max, (*shape, channels), endpoint=True).astype(kind)
    background = tuple(rng.integers(0, np.iinfo(kind).max, channels).tolist())
    data = encode_png(window, corner, size, background)
    read = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    read = read[..., ::-1] if channels == 3 else read[..., None]
    np.testing.assert_array_equal(read, whole(window, corner, size, background))


@pytest.mark.parametrize("rows", [0, 1, 40])
def test_png_is_strictly_in_order(rows):
    """Every checksum right, nothing behind the stream, as many bytes as the header says, and filters that exist."""
    window = np.random.default_rng(0).integers(0, 255, (rows, 30, 3)).astype(np.uint8)
    data, position, chunks = encode_png(window, (5, 7), (64, 48), (255, 254, 253)), 8, {}
    while position < len(data):
        length, kind = struct.unpack_from(">I4s", data, position)
        content = data[position + 8 : position + 8 + length]
        assert struct.unpack_from(">I", data, position + 8 + length)[0] == zlib.crc32(kind + content)
        chunks[kind], position = content, position + 12 + length
    assert list(chunks) == [b"IHDR", b"IDAT", b"IEND"] and position == len(data)
    stream = zlib.decompressobj()
    rows_read = np.frombuffer(stream.decompress(chunks[b"IDAT"]), np.uint8).reshape(48, 1 + 64 * 3)
    assert stream.eof and not stream.unused_data  # zlib compared the Adler-32 when it came to the end
    assert set(rows_read[:, 0]) <= {1, 2}


def test_same_pixels_same_bytes():
    window = np.random.default_rng(0).integers(0, 255, (20, 30, 3)).astype(np.uint8)
    assert encode_png(window, (5, 7), (64, 48), (9, 9, 9)) == encode_png(window, (5, 7), (64, 48), (9, 9, 9))


@pytest.mark.parametrize("rgb_suffix", ["png", "jpg"])
def test_every_kind_of_image_through_a_window(tmp_path, rgb_suffix):
    patterns = {kind: f"{kind}/{{frame}}.png" for kind in ("mask", "coverage", "normal")}
    patterns |= {kind: f"{kind}/{{frame}}.tiff" for kind in ("depth", "flow")}
    camera = make_camera(0, rgb=f"rgb/{{frame}}.{rgb_suffix}", **patterns)
    rng = np.random.default_rng(0)
    rgb = np.full((8, 8, 3), 200, np.uint8)
    mask, depth = np.full((8, 8), 513, np.uint16), rng.random((8, 8)).astype(np.float32) + 3
    normal = np.zeros((8, 8, 3), np.float32)
    normal[..., 2] = 1
    extra = FrameExtras(np.full((8, 8), 128, np.uint8), normal, rng.normal(size=(8, 8, 2)).astype(np.float32))
    write_frame(tmp_path, camera, 0, rgb, mask, depth, extra=extra, placement=Placement((8, 16), (255, 128, 0)))
    capture = Capture(tmp_path, 30.0, 1, (camera,), None)
    inside = np.zeros((HEIGHT, WIDTH), bool)
    inside[16:24, 8:16] = True
    read = read_rgb(capture, 0, 0) * 255
    np.testing.assert_allclose(read[18:22, 10:14], 200, atol=2)
    np.testing.assert_allclose(read[:8, :8], np.broadcast_to([255, 128, 0], (8, 8, 3)), atol=2)
    np.testing.assert_array_equal(read_mask(capture, 0, 0), np.where(inside, 513, 0))
    np.testing.assert_array_equal(read_depth(capture, 0, 0)[inside], depth.ravel())
    np.testing.assert_allclose(read_coverage(capture, 0, 0)[inside], 128 / 255)
    np.testing.assert_allclose(read_normal(capture, 0, 0)[inside][:, 2], 1, atol=1e-4)
    np.testing.assert_array_equal(read_flow(capture, 0, 0)[inside], extra.flow.reshape(-1, 2))
    for image in (read_depth(capture, 0, 0), read_coverage(capture, 0, 0), read_normal(capture, 0, 0)):
        assert not image[~inside].any()


def test_a_window_beyond_the_image_is_refused(tmp_path):
    camera = make_camera(0, mask=None, depth=None)
    with pytest.raises(UserError, match="a window of rgb at \\(30, 0\\) reaches beyond the image"):
        write_frame(tmp_path, camera, 0, np.zeros((8, 8, 3), np.uint8), placement=Placement((30, 0), (0, 0, 0)))
    with pytest.raises(UserError, match="rgb is 8×8, the camera 32×24"):
        write_frame(tmp_path, camera, 0, np.zeros((8, 8, 3), np.uint8))
