"""3×4 projection matrices, as NVIDIA DeepStream's multi-view tracker (MV3DT) reads them: one YAML file a camera.

`projectionMatrix_3x4_w2p` takes the world (metres) to pixels, row by row. The older `projectionMatrix_3x4` counts
pixels from the middle of the image. P = K [R | t] falls apart into an upper triangle and a rotation (RQ decomposition;
Hartley & Zisserman 2004, §6.2.4).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float64
from scipy.linalg import rq

from aerojax.capture.imports.calibration.base import CalibratedCamera, Calibration, CalibrationConfig, transform_of
from aerojax.capture.imports.calibration.documents import files_in, mapping, needed, numbers, read_document
from aerojax.capture.imports.calibration.opencv import size_of
from aerojax.core.errors import UserError

_FROM_CORNER, _FROM_CENTRE = "projectionMatrix_3x4_w2p", "projectionMatrix_3x4"
_NO_SKEW = 1e-5
"""Skew over focal length below which it is rounding."""


@dataclass(frozen=True)
class ProjectionsConfig(CalibrationConfig):
    """A folder such as `camInfo/` with a file a camera, whose name is the camera's; or its parent.

    pixel_centre: where the matrices put the centre of the top-left pixel; DeepStream's boxes begin at its corner.
    """

    name: Literal["projections"] = "projections"
    pixel_centre: float = 0.5

    def read(self, source: Path) -> Calibration:
        """Cameras in the order of their files."""
        folder = source / "camInfo" if (source / "camInfo").is_dir() else source
        return Calibration(tuple(self._camera(path) for path in files_in(folder)))

    def _camera(self, path: Path) -> CalibratedCamera:
        document = mapping(read_document(path), str(path))
        key, value = needed(document, (_FROM_CORNER, _FROM_CENTRE), str(path))
        K, world_from_cam = decompose(numbers(value, f"{path}: {key}", 12).reshape(3, 4), f"{path}: {key}")
        if key == _FROM_CORNER:
            K[:2, 2] += 0.5 - self.pixel_centre
        width, height = size_of(document, str(path))
        return CalibratedCamera(
            name=path.stem,
            K=K,
            distortion_model="none",
            distortion=(),
            world_from_cam=world_from_cam,
            width=width,
            height=height,
            from_centre=key == _FROM_CENTRE,
        )


def decompose(
    projection: Float64[np.ndarray, "3 4"], where: str
) -> tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "4 4"]]:
    """K and world_from_cam of a projection matrix of any scale and sign.

    Raises:
        UserError: it is no projection of a camera at a finite place.
    """
    left = projection[:, :3]
    if np.linalg.cond(left) > 1e12:
        raise UserError("invalid", f"{where}: is no projection matrix of a camera", "calibrate it again")
    projection = projection * np.sign(np.linalg.det(left))
    upper, rotation = (np.asarray(part) for part in rq(projection[:, :3]))
    signs = np.sign(np.diag(upper))
    K, rotation = upper * signs, signs[:, None] * rotation
    centre = -np.linalg.solve(projection[:, :3], projection[:, 3])
    K = K / K[2, 2]
    K[np.tril_indices(3, -1)] = 0.0
    if abs(K[0, 1]) < _NO_SKEW * K[0, 0]:
        K[0, 1] = 0.0
    return K, transform_of(rotation.T, centre)
