"""Lenses and poses of a network from one board that all cameras watch at the same time.

Each lens is calibrated by itself (Zhang 2000), then all poses together by OpenCV's multi-view calibration
(`cv2.calibrateMultiview`), which needs the whole board in a picture, and pairs of cameras that see it at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from jaxtyping import Bool, Float64

from aerojax.capture.calibrate.board import Board, Corners
from aerojax.capture.imports.calibration.base import UPRIGHT_FROM_CAMERA, transform_of
from aerojax.core.errors import UserError
from aerojax.geometry.cameras import invert_rigid

_FEWEST_VIEWS = 5
"""Pictures of the board that a lens needs."""
_MOST_VIEWS = 40
"""Pictures of one camera that its lens is calibrated from, spread over all."""
_LENS_FLAGS = {
    "none": cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST,
    "radial": cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST,
    "full": 0,
}

LensKind = Literal["none", "radial", "full"]
"""Distortion that is looked for: none, radial (k1, k2), or full (k1, k2, p1, p2, k3)."""


@dataclass(frozen=True, eq=False)
class CameraViews:
    """What one camera saw of the board: its corners by number of the frame, and its size in pixels."""

    name: str
    width: int
    height: int
    seen: dict[int, Corners]


@dataclass(frozen=True, eq=False)
class CalibratedNetwork:
    """The result.

    K: by camera, pixels, the centre of the top-left pixel at (0, 0). distortion: OpenCV's k1 k2 p1 p2 k3.
    world_from_cam: in the world that was asked for, metres.
    lens_px: root mean square of each lens's own residuals, pixels. network_px: of all poses together.
    """

    names: tuple[str, ...]
    K: tuple[Float64[np.ndarray, "3 3"], ...]
    distortion: tuple[tuple[float, ...], ...]
    world_from_cam: tuple[Float64[np.ndarray, "4 4"], ...]
    lens_px: tuple[float, ...]
    network_px: float


def calibrate_network(
    cameras: Sequence[CameraViews],
    board: Board,
    lens: LensKind,
    ground_frame: int | None,
    *,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> CalibratedNetwork:
    """Calibrate all lenses and poses.

    Args:
        cameras: views of the board; equal frame numbers are one moment.
        board: that was seen.
        lens: which distortion to look for.
        ground_frame: a frame in which the board lies on the ground, face up: it becomes z = 0, and its first corner
            the origin. None makes the first camera the origin of a world in which it stands level.
        progress: called after each step with (done, total, what).

    Raises:
        UserError: a camera sees too little of the board, alone or together with the others; names it.
    """
    steps = len(cameras) + 1
    lenses = []
    for camera in cameras:
        lenses.append(_lens(camera, board, lens))
        progress(len(lenses), steps, camera.name)
    frames, whole = _shared(cameras, board)
    cam_from_first, rms = _poses(cameras, board, lenses, frames, whole)
    progress(steps, steps, "poses")
    first_from_world = _first_from_world(cameras, board, lenses, cam_from_first, ground_frame)
    return CalibratedNetwork(
        names=tuple(camera.name for camera in cameras),
        K=tuple(K for K, _, _ in lenses),
        distortion=tuple(tuple(distortion.tolist()) for _, distortion, _ in lenses),
        world_from_cam=tuple(invert_rigid(pose @ first_from_world) for pose in cam_from_first),
        lens_px=tuple(error for _, _, error in lenses),
        network_px=rms,
    )


_Lens = tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "5"], float]


def _lens(camera: CameraViews, board: Board, kind: LensKind) -> _Lens:
    """K, distortion and residual of one camera from all its pictures of the board, whole or in part."""
    if len(camera.seen) < _FEWEST_VIEWS:
        raise UserError(
            "no-usable-frames",
            f"camera {camera.name} sees the board in {len(camera.seen)} frames, {_FEWEST_VIEWS} are needed",
            "record longer, closer and in light, and check `board`",
        )
    frames = sorted(camera.seen)
    chosen = [frames[i] for i in np.unique(np.linspace(0, len(frames) - 1, _MOST_VIEWS).astype(int))]
    points = [board.corners[camera.seen[frame].ids].astype(np.float32) for frame in chosen]
    pixels = [camera.seen[frame].pixels for frame in chosen]
    size = camera.width, camera.height
    found: Any = cv2.calibrateCamera(points, pixels, size, None, None, flags=_LENS_FLAGS[kind])
    distortion = np.zeros(5)
    distortion[: found[2].size] = found[2].ravel()[:5]
    return np.asarray(found[1], np.float64), distortion, float(found[0])


def _shared(cameras: Sequence[CameraViews], board: Board) -> tuple[list[int], Bool[np.ndarray, "camera frame"]]:
    """Frames in which at least two cameras see the whole board, and which of them do.

    Raises:
        UserError: a camera shares no such moment with the others.
    """
    count = len(board.corners)
    complete = [{frame for frame, corners in c.seen.items() if len(corners.ids) == count} for c in cameras]
    frames = sorted(frame for frame in set().union(*complete) if sum(frame in one for one in complete) >= 2)
    whole = np.array([[frame in one for frame in frames] for one in complete], dtype=bool).reshape(len(cameras), -1)
    reached, grew = {0}, True
    while grew:
        together = whole[sorted(reached)].any(axis=0)
        more = {i for i in range(len(cameras)) if (whole[i] & together).any()} - reached
        reached, grew = reached | more, bool(more)
    lost = [camera.name for i, camera in enumerate(cameras) if i not in reached]
    if lost:
        raise UserError(
            "no-usable-frames",
            f"no moment in which {', '.join(lost)} and the other cameras see the whole board",
            "move the board through places that two cameras see at once, and check that the clips begin together",
        )
    return frames, whole


def _poses(
    cameras: Sequence[CameraViews],
    board: Board,
    lenses: Sequence[_Lens],
    frames: Sequence[int],
    whole: Bool[np.ndarray, "camera frame"],
) -> tuple[list[Float64[np.ndarray, "4 4"]], float]:
    """cam_from_first of each camera, and the root mean square residual in pixels; lenses stay as they are."""
    empty = np.full((len(board.corners), 2), -1, np.float32)
    pixels = [
        [_ordered(camera.seen[f]) if whole[i, j] else empty for j, f in enumerate(frames)]
        for i, camera in enumerate(cameras)
    ]
    points = [board.corners.astype(np.float32)] * len(frames)
    sizes = [(camera.width, camera.height) for camera in cameras]
    K, distortion = [one.copy() for one, _, _ in lenses], [one[None].copy() for _, one, _ in lenses]
    models = np.full(len(cameras), cv2.CALIB_MODEL_PINHOLE, np.uint8)
    try:
        found: Any = cv2.calibrateMultiview(
            points,
            pixels,
            sizes,
            whole.astype(np.uint8),
            models,
            K,
            distortion,
            None,
            None,
            flags=cv2.CALIB_USE_INTRINSIC_GUESS,
        )
    except cv2.error as error:
        message = str(error).strip().splitlines()[-1][-160:]
        raise UserError("invalid", f"the poses cannot be found: {message}", "record more views of the board") from None
    poses = []
    for turn, moved in zip(found[3], found[4], strict=True):
        rotation = turn if turn.size == 9 else cv2.Rodrigues(turn)[0]
        poses.append(
            transform_of(np.asarray(rotation, np.float64).reshape(3, 3), np.asarray(moved, np.float64).ravel())
        )
    return poses, float(found[0])


def _ordered(corners: Corners) -> np.ndarray:
    return corners.pixels[np.argsort(corners.ids)]


def _first_from_world(
    cameras: Sequence[CameraViews],
    board: Board,
    lenses: Sequence[_Lens],
    cam_from_first: Sequence[Float64[np.ndarray, "4 4"]],
    ground_frame: int | None,
) -> Float64[np.ndarray, "4 4"]:
    """Of the world that was asked for: level with the first camera, or the board on the ground."""
    if ground_frame is None:
        return invert_rigid(UPRIGHT_FROM_CAMERA)
    seen = [i for i, camera in enumerate(cameras) if ground_frame in camera.seen]
    if not seen:
        raise UserError(
            "missing", f"no camera sees the board in frame {ground_frame}", "choose another ground_frame, or none"
        )
    best = max(seen, key=lambda i: len(cameras[i].seen[ground_frame].ids))
    corners, (K, distortion, _) = cameras[best].seen[ground_frame], lenses[best]
    points = board.corners[corners.ids]
    _, turn, moved = cv2.solvePnP(points, corners.pixels.astype(np.float64), K, distortion)
    cam_from_board = transform_of(np.asarray(cv2.Rodrigues(turn)[0], np.float64), np.asarray(moved, np.float64).ravel())
    # A board's z points away from whoever looks at its face (x right, y down), so up is -z.
    board_from_world = np.diag([1.0, -1.0, -1.0, 1.0])
    return invert_rigid(cam_from_first[best]) @ cam_from_board @ board_from_world
