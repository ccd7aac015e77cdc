"""COLMAP models, text and binary: `cameras` and `images`, with world-to-camera poses and quaternions w x y z.

Layout: COLMAP's documentation, "Output Format". Pixels have the centre of the top-left one at (0.5, 0.5). The unit of
length is arbitrary unless the model was scaled; `metres_per_unit` of the import scales it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

from aerojax.capture.imports.calibration.base import CalibratedCamera, Calibration, CalibrationConfig, transform_of
from aerojax.capture.imports.calibration.documents import read_text, rigid
from aerojax.capture.imports.calibration.poses import Stillness, camera_of, still_cameras
from aerojax.core.errors import UserError
from aerojax.geometry.cameras import invert_rigid

_MODELS = (
    "SIMPLE_PINHOLE",
    "PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
    "OPENCV_FISHEYE",
    "FULL_OPENCV",
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
)
"""Names by the number that binary files have."""
_COUNTS = {
    "SIMPLE_PINHOLE": 3,
    "PINHOLE": 4,
    "SIMPLE_RADIAL": 4,
    "RADIAL": 5,
    "OPENCV": 8,
    "OPENCV_FISHEYE": 8,
    "FULL_OPENCV": 12,
    "SIMPLE_RADIAL_FISHEYE": 4,
    "RADIAL_FISHEYE": 5,
}
"""Numbers of parameters of the models that can be read."""
_ONE_FOCAL = ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE")
_MOST = 10_000_000  # images or points of one file; keeps a damaged count from claiming the memory


@dataclass(frozen=True)
class ColmapConfig(CalibrationConfig):
    """A folder with cameras and images as .txt or .bin, such as `sparse/0`; poses of one camera are averaged.

    still: how far the poses of one camera's images may lie apart.
    """

    name: Literal["colmap"] = "colmap"
    still: Stillness = field(default_factory=Stillness)

    def read(self, source: Path) -> Calibration:
        """Cameras by the folders of their images; without folders every image is a camera."""
        folder = source if source.is_dir() else source.parent
        found = next((suffix for suffix in (".bin", ".txt") if (folder / f"images{suffix}").is_file()), None)
        if found is None:
            raise UserError("missing", f"source={folder}: no images.txt and no images.bin", "name the model's folder")
        binary = found == ".bin"
        lenses = _binary_lenses(folder / "cameras.bin") if binary else _text_lenses(folder / "cameras.txt")
        images_path = folder / f"images{found}"
        records = _binary_images(images_path) if binary else _text_images(images_path)
        images = [_image(record, lenses, images_path) for record in records]
        if not images:
            raise UserError("missing", f"{images_path}: holds no image", "reconstruct the cameras first")
        return Calibration(still_cameras(images, str(images_path), self.still))


@dataclass(frozen=True)
class _Lens:
    model: str
    width: int
    height: int
    parameters: tuple[float, ...]


@dataclass(frozen=True)
class _Record:
    quaternion: tuple[float, ...]
    translation: tuple[float, ...]
    lens: int
    file: str


def _image(record: _Record, lenses: dict[int, _Lens], path: Path) -> CalibratedCamera:
    if record.lens not in lenses:
        raise UserError(
            "mismatch", f"{path}: {record.file} has camera {record.lens}, which is not there", "export anew"
        )
    lens = lenses[record.lens]
    K, model, coefficients = _lens_of(lens, path)
    pose = transform_of(_rotation(record, path), np.array(record.translation))
    return CalibratedCamera(
        name=camera_of(record.file),
        K=K,
        distortion_model=model,
        distortion=coefficients,
        world_from_cam=invert_rigid(rigid(pose, f"{path}: {record.file}")),
        width=lens.width,
        height=lens.height,
        files=(record.file,),
    )


def _rotation(record: _Record, path: Path) -> Float64[np.ndarray, "3 3"]:
    quaternion = np.array(record.quaternion)
    length = np.linalg.norm(quaternion)
    if not 0.5 < length < 2:
        raise UserError("invalid", f"{path}: {record.file}: the quaternion is not of unit length", "export anew")
    w, x, y, z = quaternion / length
    # Rodrigues' formula for quaternions: R = I + 2 w [v] + 2 [v]².
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def _lens_of(lens: _Lens, path: Path) -> tuple[Float64[np.ndarray, "3 3"], str, tuple[float, ...]]:
    """K, distortion model and coefficients (COLMAP's `models.h`; OpenCV's order k1 k2 p1 p2 k3 …)."""
    values = lens.parameters
    fx, fy, cx, cy, *rest = (values[0], *values) if lens.model in _ONE_FOCAL else values
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    if lens.model.endswith("FISHEYE"):
        return K, "opencv_fisheye", (*rest, 0.0, 0.0, 0.0)[:4]
    if not any(rest):
        return K, "none", ()
    return K, "opencv", tuple(rest) if len(rest) >= 4 else (*rest, 0.0, 0.0, 0.0)[:4]


def _checked(number: int, lens: _Lens, path: Path) -> tuple[int, _Lens]:
    if lens.model not in _COUNTS:
        raise UserError(
            "invalid",
            f"{path}: camera {number} has the model {lens.model}",
            "undistort the images to PINHOLE or OPENCV",
        )
    if len(lens.parameters) != _COUNTS[lens.model]:
        wanted = _COUNTS[lens.model]
        raise UserError("invalid", f"{path}: camera {number}: {lens.model} takes {wanted} parameters", "export anew")
    return number, lens


def _rows(path: Path) -> Iterator[list[str]]:
    """Words of the lines that are no comments; empty lines stay, because images have two lines each."""
    for line in read_text(path).splitlines():
        if not line.startswith("#"):
            yield line.split()


def _text_lenses(path: Path) -> dict[int, _Lens]:
    found = {}
    for words in _rows(path):
        if words:
            try:
                lens = _Lens(words[1], int(words[2]), int(words[3]), tuple(map(float, words[4:])))
                number, lens = _checked(int(words[0]), lens, path)
            except (IndexError, ValueError) as error:
                raise _refused(error, path, " ".join(words)) from None
            found[number] = lens
    return found


def _text_images(path: Path) -> list[_Record]:
    rows, found = list(_rows(path)), []
    while rows and not rows[0]:
        rows.pop(0)
    for words in rows[::2]:  # the second line of each has the keypoints
        try:
            values = tuple(map(float, words[1:8]))
            if len(values) != 7 or len(words) < 10:
                raise ValueError
            found.append(_Record(values[:4], values[4:], int(words[8]), " ".join(words[9:])))
        except ValueError as error:
            raise _refused(error, path, " ".join(words)) from None
    return found


def _refused(error: Exception, path: Path, line: str) -> UserError:
    if isinstance(error, UserError):  # which is a ValueError
        return error
    return UserError("unreadable", f"{path}: cannot read the line {line[:60]!r}", "export the model as text again")


class _Bytes:
    """Little-endian numbers of a file, one after the other."""

    def __init__(self, path: Path) -> None:
        self.path, self.place = path, 0
        try:
            self.content = path.read_bytes()
        except OSError as error:
            raise UserError("missing", f"{path}: cannot be read: {error.strerror}", "export the model again") from None

    def take(self, layout: str) -> tuple[Any, ...]:
        start = self.place
        self.skip(struct.calcsize(layout))
        return struct.unpack_from(layout, self.content, start)

    def skip(self, size: int) -> None:
        self.place += size
        if self.place > len(self.content):
            raise UserError("unreadable", f"{self.path}: is cut short", "export the model again")

    def count(self) -> int:
        found = int(self.take("<Q")[0])
        if found > _MOST:
            raise UserError(
                "unreadable", f"{self.path}: is damaged: it claims {found} entries", "export the model again"
            )
        return found

    def text(self) -> str:
        end = self.content.find(b"\0", self.place)
        if end < 0:
            raise UserError("unreadable", f"{self.path}: is cut short", "export the model again")
        start, self.place = self.place, end + 1
        return self.content[start:end].decode("utf-8", "replace")


def _binary_lenses(path: Path) -> dict[int, _Lens]:
    file, found = _Bytes(path), {}
    for _ in range(file.count()):
        number, model, width, height = (int(value) for value in file.take("<iiQQ"))
        name = _MODELS[model] if 0 <= model < len(_MODELS) else f"number {model}"
        parameters = file.take(f"<{_COUNTS[name]}d") if name in _COUNTS else ()
        number, lens = _checked(number, _Lens(name, width, height, parameters), path)
        found[number] = lens
    return found


def _binary_images(path: Path) -> list[_Record]:
    file, found = _Bytes(path), []
    for _ in range(file.count()):
        _, *pose, lens = file.take("<I7dI")
        name = file.text()
        file.skip(24 * file.count())  # keypoints: two doubles and the point's number
        found.append(_Record(tuple(pose[:4]), tuple(pose[4:]), int(lens), name))
    return found
