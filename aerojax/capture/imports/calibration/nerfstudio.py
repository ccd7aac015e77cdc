"""nerfstudio's `transforms.json`: camera-to-world with OpenGL axes, world +Z up.

A frame's own intrinsics go before those at the top. nerfstudio samples pixel (i, j) at (i + 0.5, j + 0.5); files of
tools that count from the centre of the first pixel need `pixel_centre=0`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from aerojax.capture.imports.calibration.base import CalibratedCamera, Calibration, CalibrationConfig, intrinsics
from aerojax.capture.imports.calibration.documents import mapping, needed, number, numbers, read_document, rigid, whole
from aerojax.capture.imports.calibration.poses import Stillness, camera_of, still_cameras
from aerojax.core.errors import UserError

_OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""Acts on the columns of camera-to-world: +y and +z change sign."""
_PINHOLES = ("PINHOLE", "SIMPLE_PINHOLE")
_COEFFICIENTS = {
    "OPENCV": ("k1", "k2", "p1", "p2", "k3"),
    "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4"),
    **dict.fromkeys(_PINHOLES, ()),
}


@dataclass(frozen=True)
class NerfstudioConfig(CalibrationConfig):
    """A `transforms.json`, or the folder that holds it.

    pixel_centre: where the file has the centre of the top-left pixel.
    still: how far the poses of one camera's images may lie apart.
    """

    name: Literal["nerfstudio"] = "nerfstudio"
    pixel_centre: float = 0.5
    still: Stillness = field(default_factory=Stillness)

    def read(self, source: Path) -> Calibration:
        """Cameras by the folders of their images; without folders every image is a camera."""
        path = source / "transforms.json" if source.is_dir() else source
        document = mapping(read_document(path), str(path))
        frames = document.get("frames")
        if not isinstance(frames, list) or not frames:
            raise UserError("missing", f"{path}: frames is no list with entries", "give nerfstudio's transforms.json")
        images = [self._image(document, frame, f"{path}: frames[{index}]") for index, frame in enumerate(frames)]
        return Calibration(still_cameras(images, str(path), self.still))

    def _image(self, document: Mapping[str, Any], frame: Any, where: str) -> CalibratedCamera:
        merged = {**document, **mapping(frame, where)}
        file = str(needed(merged, ("file_path",), where)[1])
        matrix = numbers(needed(merged, ("transform_matrix",), where)[1], f"{where}.transform_matrix", 16, 12)
        world_from_gl = np.vstack([matrix.reshape(-1, 4)[:3], [0.0, 0.0, 0.0, 1.0]])
        size = [whole(needed(merged, (key,), where)[1], f"{where}.{key}") for key in ("w", "h")]
        fx, fy, cx, cy = (_value(merged, key, where) for key in ("fl_x", "fl_y", "cx", "cy"))
        model, coefficients = _distortion(merged, where)
        return CalibratedCamera(
            name=str(merged.get("camera") or camera_of(file)),
            K=intrinsics(fx, fy, cx, cy, self.pixel_centre),
            distortion_model=model,
            distortion=coefficients,
            world_from_cam=rigid(world_from_gl, f"{where}.transform_matrix") @ _OPENCV_FROM_OPENGL,
            width=size[0],
            height=size[1],
            files=(file,),
            masks=(str(merged["mask_path"]),) if merged.get("mask_path") else (),
        )


def _value(merged: Mapping[str, Any], key: str, where: str) -> float:
    """An intrinsic; fl_y may be missing where it equals fl_x."""
    keys = (key, "fl_x") if key == "fl_y" else (key,)
    return number(needed(merged, keys, where)[1], f"{where}.{key}")


def _distortion(merged: Mapping[str, Any], where: str) -> tuple[str, tuple[float, ...]]:
    model = str(merged.get("camera_model", "OPENCV"))
    if model not in _COEFFICIENTS:
        known = ", ".join(_COEFFICIENTS)
        raise UserError("invalid", f"{where}: camera_model {model!r} cannot be read", f"undistort to one of {known}")
    values = tuple(number(merged.get(key, 0.0), f"{where}.{key}") for key in _COEFFICIENTS[model])
    if model == "OPENCV_FISHEYE":
        return "opencv_fisheye", values
    return ("opencv", values) if any(values) else ("none", ())
