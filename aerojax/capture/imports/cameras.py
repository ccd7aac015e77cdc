"""A calibration and the images or videos of its cameras as a capture."""

from __future__ import annotations

import dataclasses
import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from aerojax.capture.codecs.mask import MaskKind
from aerojax.capture.format import Capture, CaptureCamera, read_capture, write_capture_json
from aerojax.capture.imports.calibration.base import UPRIGHT_FROM_CAMERA, CalibratedCamera, Calibration
from aerojax.capture.imports.calibration.documents import rigid
from aerojax.capture.imports.media import Media, Place, Placing, find_masks, find_media, lies_below
from aerojax.capture.validate.examination import FEWEST_CAMERAS
from aerojax.core.errors import UserError
from aerojax.geometry.cameras import invert_rigid
from aerojax.geometry.geodesy import GeographicOrigin

_SAME_ASPECT = 0.01
"""Relative difference of the two sides' scales below which a calibration is of the same image at another size."""


@dataclass(frozen=True)
class WorldConfig:
    """Where the calibration's world lies in the capture's (metres, +Z up).

    metres_per_unit: of the calibration's lengths; those of COLMAP are arbitrary.
    world_from_source: 16 numbers, row by row, of the rigid transform from the calibration's world; if empty, a world
        that is upright stays as it is, and the first camera's frame is turned so that this camera stands level.
    """

    metres_per_unit: float = 1.0
    world_from_source: tuple[float, ...] = ()


@dataclass(frozen=True)
class CameraImport:
    """What a calibration does not say.

    fps: frames a second; the videos' or the calibration's if None.
    frames: of the capture; all if None.
    place: how images and videos come into the capture.
    world: where the calibration's world lies.
    mask_kind: what the masks hold; None judges by how they look.
    origin: where the world's origin lies on the earth, if that is known.
    """

    fps: float | None = None
    frames: int | None = None
    place: Place = "auto"
    world: WorldConfig = field(default_factory=WorldConfig)
    mask_kind: MaskKind | None = None
    origin: GeographicOrigin | None = None


@dataclass(frozen=True, eq=False)
class Imported:
    """A capture, and what its user should know about how it was made."""

    capture: Capture
    notes: tuple[str, ...]


def import_cameras(
    calibration: Calibration,
    images: Path,
    out: Path,
    settings: CameraImport,
    *,
    masks: Path | None = None,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Imported:
    """Write a capture from calibrated cameras and their images.

    Args:
        calibration: from a member of `imports.calibration`.
        images: the folder that holds each camera's video or folder of images, by the cameras' names.
        out: becomes the capture; may exist only where it holds the images already (`place`).
        settings: what the calibration does not say.
        masks: the folder that holds each camera's folder of masks; None takes those beside the images, if any.
        progress: called after each camera with (done, total, what).

    Raises:
        UserError: files are missing or contradict the calibration, or the capture would not be valid.
    """
    if len(calibration.cameras) < FEWEST_CAMERAS:
        message = f"the calibration has {len(calibration.cameras)} cameras, a capture needs {FEWEST_CAMERAS}"
        raise UserError("invalid", message, "calibrate more cameras together")
    if (out / "capture.json").exists():
        raise UserError("occupied", f"{out}: there is a capture already", "choose another folder for out")
    media = [find_media(camera, images) for camera in calibration.cameras]
    found_masks = [find_masks(camera, masks, one) for camera, one in zip(calibration.cameras, media, strict=True)]
    place = _place(settings.place, media, found_masks, out)
    if place != "beside" and out.exists() and any(out.iterdir()):
        raise UserError("occupied", f"out={out} exists and is not empty", "choose another folder")
    notes = list(calibration.notes)
    cameras = _in_world(calibration, settings.world)
    fitted = [_fitted(camera, one, notes) for camera, one in zip(cameras, media, strict=True)]
    first = min((min(one.images) for one in media if one.images), default=0)
    target = out if place == "beside" else _stand_in(out)
    placing = Placing(out, target, first, place)
    try:
        written = []
        for camera, one, masked in zip(fitted, media, found_masks, strict=True):
            written.append(_capture_camera(camera, one, masked, placing, settings.mask_kind))
            progress(len(written), len(fitted), camera.name)
        fps = _fps(settings, fitted, media)
        frames = settings.frames or _frames(fitted, media, first, fps)
        outside = place in ("link", "absolute")
        capture = Capture(target, fps, frames, tuple(written), None, origin=settings.origin, outside=outside)
        write_capture_json(capture)
        try:
            checked = read_capture(target)  # whatever is wrong is said before the capture appears
        except UserError:
            (target / "capture.json").unlink()
            raise
        if target != out:
            if out.exists():
                out.rmdir()
            target.replace(out)
    finally:
        if target != out:
            shutil.rmtree(target, ignore_errors=True)
    return Imported(dataclasses.replace(checked, folder=out), tuple(notes))


def _place(wanted: Place, media: Sequence[Media], masks: Sequence[dict[int, Path]], out: Path) -> Place:
    """`wanted`, where it is auto by where the files lie."""
    if wanted != "auto":
        return wanted
    files = [one.video for one in media if one.video is not None]
    files += [path for one in media for path in one.images.values()] + [p for one in masks for p in one.values()]
    starts = [min(one.images) for one in media if one.images]
    return "beside" if out.is_dir() and lies_below(files, out) and not any(starts) else "hardlink"


def _stand_in(out: Path) -> Path:
    out.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(dir=out.parent, prefix=f".{out.name}-"))
    folder.chmod(0o755)
    return folder


def _in_world(calibration: Calibration, world: WorldConfig) -> list[CalibratedCamera]:
    """Cameras in metres and in the capture's world."""
    if not world.metres_per_unit > 0:
        raise UserError("out-of-range", f"world.metres_per_unit={world.metres_per_unit:g}", "give a positive number")
    first = calibration.cameras[0].world_from_cam
    move = np.eye(4) if calibration.upright else UPRIGHT_FROM_CAMERA @ invert_rigid(first)
    if world.world_from_source:
        if len(world.world_from_source) != 16:
            count = len(world.world_from_source)
            raise UserError("invalid", f"world.world_from_source has {count} numbers, not 16", "give a 4×4 matrix")
        move = rigid(np.array(world.world_from_source).reshape(4, 4), "world.world_from_source")
    return [_moved(camera, move, world.metres_per_unit) for camera in calibration.cameras]


def _moved(camera: CalibratedCamera, move: Float64[np.ndarray, "4 4"], scale: float) -> CalibratedCamera:
    pose = camera.world_from_cam.copy()
    pose[:3, 3] *= scale
    return dataclasses.replace(camera, world_from_cam=move @ pose)


def _fitted(camera: CalibratedCamera, media: Media, notes: list[str]) -> CalibratedCamera:
    """The camera with the size of its images; K is scaled where the calibration is of another size.

    Raises:
        UserError: the sides differ by different factors.
    """
    width, height = camera.width or media.width, camera.height or media.height
    K = camera.K.copy()
    if camera.from_centre:
        K[:2, 2] += width / 2, height / 2
    if (width, height) != (media.width, media.height):
        wide, high = media.width / width, media.height / height
        sizes = f"{width}×{height}, its images {media.width}×{media.height}"
        if abs(wide / high - 1) > _SAME_ASPECT:
            raise UserError(
                "mismatch", f"camera {camera.name} was calibrated at {sizes}", "calibrate the images as they are"
            )
        K = np.diag([wide, high, 1.0]) @ K
        notes.append(f"camera {camera.name} was calibrated at {sizes}: K was scaled")
    return dataclasses.replace(camera, K=K, width=media.width, height=media.height, from_centre=False)


def _capture_camera(
    camera: CalibratedCamera, media: Media, masks: dict[int, Path], placing: Placing, kind: MaskKind | None
) -> CaptureCamera:
    if media.video is not None:
        rgb = placing.video(camera.name, media.video)
    else:
        rgb = placing.images(camera.name, "rgb", media.images)
    return CaptureCamera(
        name=camera.name,
        width=media.width,
        height=media.height,
        K=camera.K,
        distortion_model=camera.distortion_model,
        distortion=camera.distortion,
        world_from_cam=camera.world_from_cam,
        rgb=rgb,
        mask=placing.images(camera.name, "mask", masks) if masks else None,
        depth=None,
        time_offset_s=camera.time_offset_s,
        mask_kind=kind if masks else None,
    )


def _fps(settings: CameraImport, cameras: Sequence[CalibratedCamera], media: Sequence[Media]) -> float:
    known = [settings.fps, *(one.fps for one in media), *(camera.fps for camera in cameras)]
    fps = next((value for value in known if value), None)
    if fps is None:
        raise UserError("missing", "the frames a second are not known", "set fps=, for example fps=30")
    if not fps > 0:
        raise UserError("out-of-range", f"fps={fps:g} must be positive", "give frames a second")
    return float(fps)


def _frames(cameras: Sequence[CalibratedCamera], media: Sequence[Media], first: int, fps: float) -> int:
    """Frames until the last camera stops."""
    ends = []
    for camera, one in zip(cameras, media, strict=True):
        own = one.count * fps / (one.fps or fps) if one.video is not None else max(one.images) - first + 1
        ends.append(own + max(camera.time_offset_s, 0.0) * fps)
    return max(1, int(max(ends) + 1e-6))
