"""Float TIFFs: written in tiles, read back whatever the tiling, refused where they are of another kind."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from aerojax.capture.codecs.headers import read_header
from aerojax.capture.codecs.tiff import BrokenTiff, decode_tiff, encode_tiff

WINDOWS = [((300, 200), (120, 90), (37, 51)), ((130, 129), (1, 1), (129, 128)), ((40, 30), (40, 30), (0, 0))]


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize(("size", "shape", "corner"), [*WINDOWS, ((200, 140), (0, 0), (0, 0))])
def test_float_tiff_of_a_window(tmp_path, size, shape, corner, channels):
    window = np.random.default_rng(0).normal(size=(shape[1], shape[0], channels)).astype(np.float32)
    expected = np.zeros((size[1], size[0], channels), np.float32)
    expected[corner[1] : corner[1] + shape[1], corner[0] : corner[0] + shape[0]] = window
    data = encode_tiff(window, corner, size)
    np.testing.assert_array_equal(decode_tiff(data), expected)
    if channels == 1:  # OpenCV opens no float TIFF of two channels
        np.testing.assert_array_equal(
            cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED), expected[..., 0]
        )
    (tmp_path / "a.tiff").write_bytes(data)
    header = read_header(tmp_path / "a.tiff")
    assert (header.width, header.height, header.channels, header.bits, header.floating) == (*size, channels, 32, True)


def test_strips_of_other_writers_are_read():
    image = np.random.default_rng(1).normal(size=(70, 33)).astype(np.float32)
    data = cv2.imencode(".tiff", image, [cv2.IMWRITE_TIFF_COMPRESSION, 1])[1].tobytes()
    np.testing.assert_array_equal(decode_tiff(data)[..., 0], image)
    with pytest.raises(BrokenTiff, match="stored in a way"):
        decode_tiff(cv2.imencode(".tiff", image, [cv2.IMWRITE_TIFF_COMPRESSION, 5])[1].tobytes())
    with pytest.raises(BrokenTiff, match="not float32"):
        decode_tiff(cv2.imencode(".tiff", np.zeros((4, 4), np.uint8))[1].tobytes())
