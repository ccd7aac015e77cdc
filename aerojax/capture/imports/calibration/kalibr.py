"""Kalibr's camchain: `cam0`, `cam1`, … each with its transform from the camera before it.

Kalibr's wiki, "YAML formats": intrinsics fu fv pu pv; T_cn_cnm1 takes points of camera n-1 to camera n, so poses are
the product of the chain; T_cam_imu takes the IMU to the camera; timeshift_cam_imu is t_imu = t_cam + shift. There is no
world: it is the frame of cam0, which the import turns upright unless it is told where the world lies. Corners are found
with OpenCV, which puts the centre of the top-left pixel at (0, 0).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

from aerojax.capture.imports.calibration.base import CalibratedCamera, Calibration, CalibrationConfig, intrinsics
from aerojax.capture.imports.calibration.documents import (
    files_in,
    mapping,
    needed,
    number,
    numbers,
    read_document,
    rigid,
)
from aerojax.core.errors import UserError
from aerojax.geometry.cameras import invert_rigid

_MODELS = {"radtan": ("opencv", 4), "equidistant": ("opencv_fisheye", 4), "none": ("none", 0)}
"""Distortion model of a capture and number of coefficients, by Kalibr's name."""


@dataclass(frozen=True)
class KalibrConfig(CalibrationConfig):
    """A camchain.yaml.

    names: of the cameras in the chain's order; cam0, cam1, … if empty.
    pixel_centre: where the file has the centre of the top-left pixel.
    """

    name: Literal["kalibr"] = "kalibr"
    names: tuple[str, ...] = ()
    pixel_centre: float = 0.0

    def read(self, source: Path) -> Calibration:
        """Cameras in the chain's order."""
        path = files_in(source, (".yaml", ".yml"))[0]
        document = mapping(read_document(path), str(path))
        cameras = (key for key in document if isinstance(key, str) and re.fullmatch(r"cam\d+", key))
        keys = sorted(cameras, key=lambda key: int(key[3:]))
        if not keys:
            raise UserError("missing", f"{path}: has no cam0", "give Kalibr's camchain")
        if self.names and len(self.names) != len(keys):
            message = f"calibration.names has {len(self.names)} names, {path} has {len(keys)} cameras"
            raise UserError("mismatch", message, "name them all or none")
        entries = [mapping(document[key], f"{path}: {key}") for key in keys]
        chain = _chain(entries, [f"{path}: {key}" for key in keys])
        shifts = [number(entry.get("timeshift_cam_imu", 0.0), f"{path}: {keys[i]}") for i, entry in enumerate(entries)]
        cameras = tuple(
            self._camera(name, entry, f"{path}: {key}", cam_from_first, shift - shifts[0])
            for name, key, entry, cam_from_first, shift in zip(
                self.names or keys, keys, entries, chain, shifts, strict=True
            )
        )
        return Calibration(cameras, upright=False)

    def _camera(
        self, name: str, entry: Mapping[str, Any], where: str, cam_from_first: Float64[np.ndarray, "4 4"], late_s: float
    ) -> CalibratedCamera:
        if entry.get("camera_model", "pinhole") != "pinhole":
            raise UserError("invalid", f"{where}: camera_model {entry['camera_model']!r}", "calibrate it as pinhole")
        model, count = _MODELS.get(str(entry.get("distortion_model", "none")), (None, 0))
        if model is None:
            known = ", ".join(_MODELS)
            raise UserError("invalid", f"{where}: distortion_model {entry['distortion_model']!r}", f"use {known}")
        values = tuple(numbers(entry.get("distortion_coeffs", []), f"{where}.distortion_coeffs", count).tolist())
        fu, fv, pu, pv = numbers(needed(entry, ("intrinsics",), where)[1], f"{where}.intrinsics", 4).tolist()
        width, height = numbers(needed(entry, ("resolution",), where)[1], f"{where}.resolution", 2)
        plain = model == "opencv" and not any(values)
        return CalibratedCamera(
            name=name,
            K=intrinsics(fu, fv, pu, pv, self.pixel_centre),
            distortion_model="none" if plain else model,
            distortion=() if plain else values,
            world_from_cam=invert_rigid(cam_from_first),
            width=int(width),
            height=int(height),
            time_offset_s=late_s,
        )


def _chain(entries: list[Mapping[str, Any]], where: list[str]) -> list[Float64[np.ndarray, "4 4"]]:
    """cam_n_from_cam_0 of every camera: the product of T_cn_cnm1, or by way of the IMU."""
    found = [np.eye(4)]
    for index in range(1, len(entries)):
        if entries[index].get("T_cn_cnm1") is not None:
            found.append(_pose(entries[index], "T_cn_cnm1", where[index]) @ found[-1])
        else:
            imu_from_first = invert_rigid(_pose(entries[0], "T_cam_imu", where[0]))
            found.append(_pose(entries[index], "T_cam_imu", where[index]) @ imu_from_first)
    return found


def _pose(entry: Mapping[str, Any], key: str, where: str) -> Float64[np.ndarray, "4 4"]:
    keys = (key,) if key == "T_cam_imu" else (key, "T_cam_imu")
    return rigid(numbers(needed(entry, keys, where)[1], f"{where}.{key}", 16).reshape(4, 4), f"{where}.{key}")
