"""Texture images as PNG files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from aerojax.core.errors import UserError
from aerojax.core.files import write_bytes


def write_texture(path: Path, image: UInt8[np.ndarray, "row column _"], *, compression: int | None = None) -> None:
    """Write an sRGB image in one step; the same image gives the same bytes.

    Args:
        path: of the PNG file.
        image: RGB or RGBA, top row first.
        compression: zlib's level, 0 to 9; None is OpenCV's fastest.

    Raises:
        UserError: if the folder cannot be written.
    """
    order = [2, 1, 0, 3][: image.shape[2]]
    options = [] if compression is None else [cv2.IMWRITE_PNG_COMPRESSION, compression]
    done, encoded = cv2.imencode(".png", np.ascontiguousarray(image[:, :, order]), options)
    if not done:
        raise UserError("invalid", f"{path}: the texture could not be encoded", "check that OpenCV was built with PNG")
    try:
        write_bytes(path, encoded.tobytes())
    except OSError as error:
        raise UserError(
            "invalid", f"{path}: the texture cannot be written ({error.strerror})", "check folder and space"
        ) from error
