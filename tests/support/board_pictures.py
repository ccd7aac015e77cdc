"""Pictures of a calibration board as pinhole cameras see it: a plane, warped, supersampled and blurred a little."""

from __future__ import annotations

import cv2
import numpy as np

from aerojax.capture.calibrate.board import BoardConfig
from aerojax.geometry.cameras import invert_rigid

PIXELS_PER_METRE = 1000
_SUPERSAMPLING = 3


def board_image(config: BoardConfig) -> np.ndarray:
    """The board as it is printed, with a white margin of half a square."""
    size = (
        round(config.columns * config.square * PIXELS_PER_METRE),
        round(config.rows * config.square * PIXELS_PER_METRE),
    )
    if config.kind == "charuco":
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, config.dictionary))
        board = cv2.aruco.CharucoBoard((config.columns, config.rows), config.square, config.marker, dictionary)
        return board.generateImage(size)
    side = round(config.square * PIXELS_PER_METRE)
    rows, columns = np.mgrid[: size[1], : size[0]] // side
    return np.where((rows + columns) % 2, 255, 0).astype(np.uint8)


def picture(
    printed: np.ndarray,
    corner_offset: float,
    K: np.ndarray,
    world_from_cam: np.ndarray,
    world_from_board: np.ndarray,
    size: tuple[int, int],
) -> np.ndarray:
    """Grey image of a board; K in the house's convention.

    Args:
        printed: from `board_image`.
        corner_offset: where the board's frame has its origin on the print, metres from the top left corner.
    """
    cam_from_board = invert_rigid(world_from_cam) @ world_from_board
    plane = K @ np.stack([cam_from_board[:3, 0], cam_from_board[:3, 1], cam_from_board[:3, 3]], axis=1)
    # Print pixel (centre at its index) to metres on the board, and house pixels to supersampled ones of OpenCV.
    from_print = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, PIXELS_PER_METRE]]) / PIXELS_PER_METRE
    from_print[:2, 2] -= corner_offset
    finer = np.diag([_SUPERSAMPLING, _SUPERSAMPLING, 1.0])
    finer[:2, 2] = -0.5
    wide = size[0] * _SUPERSAMPLING, size[1] * _SUPERSAMPLING
    frame = round(0.04 * PIXELS_PER_METRE)
    padded = cv2.copyMakeBorder(printed, frame, frame, frame, frame, cv2.BORDER_CONSTANT, value=255)
    unpadded = np.eye(3)
    unpadded[:2, 2] = -frame
    seen = cv2.warpPerspective(
        padded, finer @ plane @ from_print @ unpadded, wide, flags=cv2.INTER_LINEAR, borderValue=110
    )
    return cv2.GaussianBlur(cv2.resize(seen, size, interpolation=cv2.INTER_AREA), (3, 3), 0.6)
