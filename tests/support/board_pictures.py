"""Pictures of a calibration board as pinhole cameras see it: a plane, warped, supersampled and blurred a little."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from aerojax.capture.calibrate.board import BoardConfig
from aerojax.geometry.cameras import invert_rigid, look_at

SIZE = 480, 360
CHARUCO = BoardConfig(columns=7, rows=5, square=0.08, marker=0.06)
CHESS = BoardConfig(kind="chessboard", columns=7, rows=6, square=0.08)
CENTRES = ((-0.8, -1.5, 1.3), (0.1, -1.7, 1.2), (0.9, -1.4, 1.0))
FRAMES = 12
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


def board_cameras() -> tuple[list[np.ndarray], list[np.ndarray]]:
    """K and pose of three cameras that look at one place."""
    target = np.array([0.0, 0.0, 1.0])
    K = [np.array([[500.0 + 8 * i, 0, 243.0 - 2 * i], [0, 502.0 + 8 * i, 178.0 + i], [0, 0, 1]]) for i in range(3)]
    return K, [np.asarray(look_at(np.array(centre), target), np.float64) for centre in CENTRES]


def board_poses(config: BoardConfig) -> list[np.ndarray]:
    """The board upright before the cameras, turned and moved; in frame 0 it lies on the ground, face up."""
    rng = np.random.default_rng(3)
    middle = np.array([config.columns, config.rows, 0.0]) * config.square / 2
    found = []
    for frame in range(FRAMES):
        rotation = cv2.Rodrigues(rng.normal(size=3) * 0.3)[0] @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
        place = np.array([0.0, 0.0, 1.0]) + rng.normal(size=3) * [0.12, 0.1, 0.08]
        if frame == 0:
            rotation, place = np.diag([1.0, -1.0, -1.0]), np.array([0.0, -0.2, 0.6])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, place - rotation @ middle
        found.append(pose)
    return found


def write_recording(folder: Path, config: BoardConfig, *, videos: bool = False) -> None:
    """A folder of images for each camera, or a video of 10 frames a second."""
    K, placed = board_cameras()
    printed = board_image(config)
    offset = config.square if config.kind == "chessboard" else 0.0  # its first corner is one square from the edge
    for index in range(3):
        name = f"cam_{index}"
        (folder / name if not videos else folder).mkdir(parents=True, exist_ok=True)
        pictures = []
        for pose in board_poses(config):
            shifted = pose.copy()
            shifted[:3, 3] += pose[:3, :2] @ np.full(2, offset)
            pictures.append(picture(printed, offset, K[index], placed[index], shifted, SIZE))
        if not videos:
            for frame, image in enumerate(pictures):
                cv2.imwrite(str(folder / f"{name}/{frame:04d}.png"), image)
            continue
        writer = cv2.VideoWriter(str(folder / f"{name}.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, SIZE)
        for image in pictures:
            writer.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
        writer.release()
