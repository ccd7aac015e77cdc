"""The board in the videos or images of a network, and the calibration as a file that `import_cameras` reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import UInt8

from aerojax.capture.calibrate.board import Board, Corners
from aerojax.capture.calibrate.network import CalibratedNetwork, CameraViews
from aerojax.capture.codecs.video import BrokenVideo, open_video
from aerojax.capture.format import CaptureCamera
from aerojax.capture.imports.media import Media, find_cameras
from aerojax.capture.validate.examination import FEWEST_CAMERAS
from aerojax.core.errors import UserError


def look_for_board(
    folder: Path,
    board: Board,
    step: int,
    *,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> tuple[CameraViews, ...]:
    """The board in every `step`-th frame of all cameras, by the names of their videos or folders.

    Args:
        folder: that holds a video or a folder of images for each camera, which began at the same time.
        board: to look for.
        step: frames between those that are looked at.
        progress: called after each picture with (done, total, what).

    Raises:
        UserError: there are too few cameras, or a file cannot be read.
    """
    if step < 1:
        raise UserError("out-of-range", f"step={step}", "look at every frame with step=1, at every tenth with step=10")
    found = find_cameras(folder)
    if len(found) < FEWEST_CAMERAS:
        message = f"{folder}: {len(found)} videos or folders of images, a network has at least {FEWEST_CAMERAS}"
        raise UserError("missing", message, "put the video or images of each camera there, named by the camera")
    total = sum(len(range(0, media.count, step)) for media in found.values())
    done, cameras = 0, []
    for name, media in found.items():
        seen: dict[int, Corners] = {}
        for frame in range(0, media.count, step):
            grey = _grey(media, frame)
            corners = None if grey is None else board.find(grey)
            if corners is not None:
                seen[frame] = corners
            done += 1
            progress(done, total, f"{name}: board in {len(seen)}")
        cameras.append(CameraViews(name, media.width, media.height, seen))
    return tuple(cameras)


def _grey(media: Media, frame: int) -> UInt8[np.ndarray, "height width"] | None:
    """One picture; None where there is none."""
    if media.video is not None:
        fps = media.fps or 30.0
        try:
            picture = open_video(media.video).read_at(frame / fps, 0.5 / fps)
        except BrokenVideo:
            return None  # the index promised more than the file holds
        return None if picture is None else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    path = media.images.get(frame + min(media.images))
    return None if path is None else cv2.imread(str(path), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)


def calibration_document(cameras: Sequence[CameraViews], network: CalibratedNetwork) -> dict[str, Any]:
    """The calibration as one JSON file of several cameras in OpenCV's words, and poses as `world_from_cam`."""
    entries = [
        {
            "name": camera.name,
            "image_width": camera.width,
            "image_height": camera.height,
            "camera_matrix": network.K[index].tolist(),
            "distortion_coefficients": list(network.distortion[index]),
            "world_from_cam": network.world_from_cam[index].tolist(),
            "rms_px": network.lens_px[index],
        }
        for index, camera in enumerate(cameras)
    ]
    return {"cameras": entries, "rms_px": network.network_px}


def as_capture_cameras(cameras: Sequence[CameraViews], network: CalibratedNetwork) -> tuple[CaptureCamera, ...]:
    """The network in this house's conventions, for pictures of it; there are no files yet."""
    made = []
    for index, camera in enumerate(cameras):
        K = network.K[index].copy()
        K[:2, 2] += 0.5
        made.append(
            CaptureCamera(
                name=camera.name,
                width=camera.width,
                height=camera.height,
                K=K,
                distortion_model="opencv",
                distortion=network.distortion[index],
                world_from_cam=network.world_from_cam[index],
                rgb="",
                mask=None,
                depth=None,
                time_offset_s=0.0,
            )
        )
    return tuple(made)
