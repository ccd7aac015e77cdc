"""Which other convention of cameras would let the silhouettes meet, where they do not meet as the cameras are given.

Files of other tools differ in the direction of the transform, in the camera's axes, in where pixels count from and in
the resolution that K is for. Nothing here changes a camera: what fits is named, and its user corrects the file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import Silhouette
from aerojax.geometry.cameras import invert_rigid, points_in_camera, project_points
from aerojax.track.single import triangulate

FITS, FAILS = 0.9, 0.5
"""Shares of the silhouettes that must see the meeting point with the other convention, and may with the given one."""
OFF, OFF_PIXELS = 0.5, 3.0
"""How far from it a silhouette's centre may be, in diagonals of its box and in pixels."""
FEWEST_CAMERAS = 3
"""Two rays meet nearly always."""

Pose = Float64[np.ndarray, "4 4"]


@dataclass(frozen=True)
class Convention:
    """A way to read cameras that lets silhouettes meet.

    name: what the file seems to hold. remedy: what to write instead.
    """

    name: str
    remedy: str


@dataclass(frozen=True)
class _Change:
    convention: Convention
    camera: Callable[[CaptureCamera], CaptureCamera]


def _axes(rows: list[list[int]]) -> Pose:
    turned = np.eye(4)
    turned[:3, :3] = rows
    return turned


_OPENGL = _axes([[1, 0, 0], [0, -1, 0], [0, 0, -1]])
_FORWARD_LEFT_UP = _axes([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
_FORWARD_RIGHT_DOWN = _axes([[0, 0, 1], [1, 0, 0], [0, 1, 0]])


def _transposed(pose: Pose) -> Pose:
    turned = pose.copy()
    turned[:3, :3] = pose[:3, :3].T
    return turned


def _with_centre(pose: Pose) -> Pose:
    """Of a rotation of world_from_cam and the translation t of cam_from_world: the centre is -R t."""
    moved = pose.copy()
    moved[:3, 3] = -pose[:3, :3] @ pose[:3, 3]
    return moved


_POSES: tuple[tuple[str, str, Callable[[Pose], Pose]], ...] = (
    ("world_from_cam holds cam_from_world", "write its inverse", invert_rigid),
    ("world_from_cam has OpenGL axes (y up, z backward)", "negate its second and third column", lambda p: p @ _OPENGL),
    (
        "world_from_cam holds cam_from_world with OpenGL axes (y up, z backward)",
        "write its inverse and negate the second and third column of that",
        lambda p: invert_rigid(p) @ _OPENGL,
    ),
    ("the rotation in world_from_cam is transposed", "transpose its upper left 3×3", _transposed),
    (
        "the translation in world_from_cam is that of cam_from_world",
        "write the camera's centre, -R t, in the last column",
        _with_centre,
    ),
    (
        "world_from_cam has axes x forward, y left, z up",
        "write the axes right, down, forward as its columns: -y, -z, x",
        lambda p: p @ _FORWARD_LEFT_UP,
    ),
    (
        "world_from_cam has axes x forward, y right, z down",
        "write the axes right, down, forward as its columns: y, z, x",
        lambda p: p @ _FORWARD_RIGHT_DOWN,
    ),
)


def _flipped(camera: CaptureCamera, *, x: bool, y: bool) -> CaptureCamera:
    """The camera of images whose columns or rows run the other way: u = width - u', v = height - v'."""
    flip = np.eye(3)
    if x:
        flip[0] = [-1, 0, camera.width]
    if y:
        flip[1] = [0, -1, camera.height]
    return replace(camera, K=flip @ camera.K)


def _scaled(camera: CaptureCamera) -> CaptureCamera:
    """K brought to the image's size by its principal point, which lies about the middle."""
    scale = (camera.width / camera.K[0, 2] + camera.height / camera.K[1, 2]) / 4 if camera.K[:2, 2].all() else 1.0
    return replace(camera, K=np.diag([scale, scale, 1.0]) @ camera.K)


def _centred(camera: CaptureCamera) -> CaptureCamera:
    K = camera.K.copy()
    K[:2, 2] = camera.width / 2, camera.height / 2
    return replace(camera, K=K)


_IMAGES: tuple[tuple[str, str, Callable[[CaptureCamera], CaptureCamera]], ...] = (
    (
        "the images are upside down (rows counted from below)",
        "flip them, or write height - cy and -fy",
        lambda c: _flipped(c, x=False, y=True),
    ),
    ("the images are mirrored", "mirror them", lambda c: _flipped(c, x=True, y=False)),
    (
        "the images are turned by 180°",
        "turn them, or calibrate the stored pixels",
        lambda c: _flipped(c, x=True, y=True),
    ),
    ("K is of another resolution", "scale its first two rows to the images' size", _scaled),
    ("the principal point in K is not in pixels from the top left", "write about half the width and height", _centred),
)


def _posed(change: Callable[[Pose], Pose]) -> Callable[[CaptureCamera], CaptureCamera]:
    return lambda camera: replace(camera, world_from_cam=change(camera.world_from_cam))


def _both(
    one: Callable[[CaptureCamera], CaptureCamera], other: Callable[[CaptureCamera], CaptureCamera]
) -> Callable[[CaptureCamera], CaptureCamera]:
    return lambda camera: one(other(camera))


def _changes() -> Iterator[tuple[_Change, ...]]:
    """Changes to try: one thing at a time, then a pose and an image together."""
    poses = [_Change(Convention(name, remedy), _posed(change)) for name, remedy, change in _POSES]
    images = [_Change(Convention(name, remedy), change) for name, remedy, change in _IMAGES]
    yield tuple(poses + images)
    yield tuple(
        _Change(
            Convention(
                f"{p.convention.name}, and {i.convention.name}", f"{p.convention.remedy}; {i.convention.remedy}"
            ),
            _both(p.camera, i.camera),
        )
        for p in poses
        for i in images
    )


def fitting_convention(frames: Sequence[Sequence[Silhouette]], cameras: Sequence[CaptureCamera]) -> Convention | None:
    """The simplest other convention with which the silhouettes of these frames meet.

    Args:
        frames: silhouettes of one object, one list a frame.
        cameras: as they were given, in any frame that they share; transforms are changed in the world's, so these must
            be the capture's own.

    Returns:
        None where they meet as given, no usual convention lets them meet, or too few cameras see anything.
    """
    seen = [whole for frame in frames if len(whole := [one for one in frame if one.whole]) >= FEWEST_CAMERAS]
    if not seen or _agreement(seen, cameras)[0] > FAILS:
        return None
    for changes in _changes():
        tried = [(_agreement(seen, [change.camera(c) for c in cameras]), change.convention) for change in changes]
        (share, _), best = max(tried, key=lambda one: one[0])
        if share >= FITS:
            return best
    return None


def _agreement(frames: Sequence[Sequence[Silhouette]], cameras: Sequence[CaptureCamera]) -> tuple[float, float]:
    """Share of the silhouettes that see the point where their rays meet, and minus their median offset from it."""
    off = [value for silhouettes in frames for value in _offsets(silhouettes, cameras)]
    return float(np.mean([value <= 1 for value in off])), -float(np.median(off))


def _offsets(silhouettes: Sequence[Silhouette], cameras: Sequence[CaptureCamera]) -> list[float]:
    """Distance of each silhouette's centre from the meeting point, 1 = as far as may be."""
    found = triangulate(silhouettes, cameras, 1.0)
    if found is None:
        return [np.inf] * len(silhouettes)
    point, _ = found
    return [_offset(one, cameras[one.camera], point) for one in silhouettes]


def _offset(one: Silhouette, camera: CaptureCamera, point: Float64[np.ndarray, "3"]) -> float:
    if points_in_camera(point, camera)[2] <= 0:
        return np.inf
    x0, y0, x1, y1 = one.box
    centre = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    off = np.linalg.norm(project_points(point, camera) - centre)
    return float(off / (OFF * np.hypot(x1 - x0, y1 - y0) + OFF_PIXELS))
