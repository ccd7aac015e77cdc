"""Calibration boards: where their corners are, and where a picture shows them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from jaxtyping import Float32, Float64, Int64, UInt8

from aerojax.core.errors import UserError

_FEWEST_CORNERS = 6
"""Of a picture that counts; four fix a pose, and more say how well."""


@dataclass(frozen=True)
class BoardConfig:
    """A flat board.

    kind: charuco (a chessboard with markers, which may be seen in part) or chessboard (which must be seen whole).
    columns, rows: squares, not corners.
    square: side of a square, metres; measure it on the print.
    marker: side of a marker, metres (charuco).
    dictionary: of the markers, one of OpenCV's names (charuco).
    legacy: whether the board was made by OpenCV before 4.6 and has a marker in the first square (charuco).
    """

    kind: Literal["charuco", "chessboard"] = "charuco"
    columns: int = 7
    rows: int = 5
    square: float = 0.1
    marker: float = 0.075
    dictionary: str = "DICT_4X4_50"
    legacy: bool = False


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners of the board in one picture.

    ids: their numbers. pixels: where they are; the centre of the top-left pixel is (0, 0), as OpenCV has it.
    """

    ids: Int64[np.ndarray, "corner"]
    pixels: Float32[np.ndarray, "corner 2"]


class Board:
    """A board that can be looked for.

    corners: of all of it, metres, in its own plane (z = 0), by number.
    """

    def __init__(self, config: BoardConfig) -> None:
        self.config = config
        _check(config)
        self._charuco: Any = None
        if config.kind == "charuco":
            dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, config.dictionary))
            board = cv2.aruco.CharucoBoard((config.columns, config.rows), config.square, config.marker, dictionary)
            board.setLegacyPattern(config.legacy)
            self._charuco = cv2.aruco.CharucoDetector(board)
            self.corners: Float64[np.ndarray, "corner 3"] = np.asarray(board.getChessboardCorners(), np.float64)
        else:
            x, y = np.meshgrid(np.arange(config.columns - 1), np.arange(config.rows - 1))
            flat = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
            self.corners = config.square * flat.astype(np.float64)

    def find(self, grey: UInt8[np.ndarray, "height width"]) -> Corners | None:
        """The board's corners in a picture; None where too little of it is seen."""
        if self._charuco is None:
            size = self.config.columns - 1, self.config.rows - 1
            found, pixels = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
            return Corners(np.arange(len(self.corners)), _pixels(pixels)) if found else None
        pixels, ids, _, _ = self._charuco.detectBoard(grey)
        if ids is None or len(ids) < _FEWEST_CORNERS:
            return None
        return Corners(np.ravel(ids).astype(np.int64), _pixels(pixels))


def _pixels(found: np.ndarray) -> Float32[np.ndarray, "corner 2"]:
    return np.reshape(found, (-1, 2)).astype(np.float32)


def _check(config: BoardConfig) -> None:
    """Refuse boards that cannot be.

    Raises:
        UserError: names the field.
    """
    if config.columns < 3 or config.rows < 3:
        size = f"{config.columns}×{config.rows}"
        raise UserError("out-of-range", f"board has {size} squares", "count the squares; there are at least 3×3")
    if not config.square > 0:
        raise UserError("out-of-range", f"board.square={config.square:g}", "give the side of a square in metres")
    if config.kind == "charuco":
        if not 0 < config.marker < config.square:
            raise UserError("out-of-range", f"board.marker={config.marker:g}", "markers are smaller than squares")
        known = [name for name in dir(cv2.aruco) if name.startswith("DICT_")]
        if config.dictionary not in known:
            raise UserError("invalid", f"board.dictionary={config.dictionary}", f"choose one of {', '.join(known)}")
    elif (config.columns - config.rows) % 2 == 0:
        message = f"a chessboard of {config.columns}×{config.rows} squares looks the same when it is turned by 180°"
        raise UserError("invalid", message, "use a board with one odd and one even side, so that cameras agree on it")
