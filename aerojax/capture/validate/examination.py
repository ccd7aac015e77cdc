"""Everything that is wrong with a capture, found in one pass; of images, some masks alone are decoded."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerojax.capture.codecs.mask import MaskKind
from aerojax.capture.lenses import COEFFICIENT_COUNTS
from aerojax.capture.paths import is_inside, relative_path_problem
from aerojax.capture.validate.files import check_frame_files
from aerojax.capture.validate.findings import Clock, Findings, Problem, shown
from aerojax.capture.validate.masks import check_masks
from aerojax.capture.validate.truth import check_truth

FORMAT, VERSION = "aerojax-capture", 1
OPTIONAL = ("truth", "missing", "origin", "outside")
CAMERA_KEYS = ("name", "width", "height", "K", "distortion", "world_from_cam", "rgb")
OPTIONAL_IMAGES = ("mask", "depth", "coverage", "normal", "flow")
MOST_FRAMES = 1_000_000  # nine hours at 30 frames per second
LARGEST_SIDE = 16_384  # above every sensor in use; keeps a forged header from claiming the memory
LARGEST_JSON = 64 * 2**20  # bytes; ten thousand frames of ten objects in ten cameras stay below it
FEWEST_CAMERAS = 3
MISSING = ("drop", "refuse")
"""What to do with files that are missing or damaged: leave out that camera in that frame, or refuse the capture."""
EXACT_ROTATION, ROUNDED_ROTATION = 1e-6, 1e-3
"""Largest entry of R Rᵀ - I of a rotation that is taken as it is (single precision is 2e-7 off), and of one whose
digits were rounded (four decimals are up to 2e-4 off) and that is made orthonormal with a warning."""
_SAME_CENTRE = 1e-6  # metres


@dataclass(frozen=True)
class Examination:
    """The parsed files of a capture and what is wrong with them; the files are None where they could not be parsed.

    problems: for which the capture is refused. warnings: what its user should know.
    masks: what the masks hold of cameras that do not say it; None without such, or where they are empty.
    """

    capture: dict[str, Any] | None
    truth: dict[str, Any] | None
    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...] = ()
    masks: MaskKind | None = None


def problems(folder: Path) -> list[Problem]:
    """Every problem of the capture in `folder`, in the order of the file; empty for a good one. Writes nothing."""
    return list(examine(folder).problems)


def examine(folder: Path) -> Examination:
    """Parse and check a capture: JSON, cameras, files and truth."""
    findings = Findings("capture.json")
    if not folder.is_dir():
        findings.add("", f"{folder} is not a folder", "give the folder that contains capture.json", file=folder.name)
        return Examination(None, None, tuple(findings.problems))
    raw = _load_json(folder, "capture.json", findings)
    if raw is None or not _is_known_format(raw, findings):
        return Examination(None, None, tuple(findings.problems))
    findings.mapping(raw, "", ("format", "version", "fps", "frames", "cameras"), OPTIONAL)
    fps, frames = _check_clock(raw, findings)
    clock = Clock(fps, frames, refuse=_check_missing(raw, findings) == "refuse", outside=_check_outside(raw, findings))
    _check_origin(raw, findings)
    check_cameras(_cameras(raw, findings), findings, CAMERA_KEYS, (*OPTIONAL_IMAGES, "time_offset_s", "mask_kind"))
    for index, camera in enumerate(raw["cameras"] if isinstance(raw.get("cameras"), list) else ()):
        if isinstance(camera, dict):
            _check_offset(camera, f"cameras[{index}].time_offset_s", fps, frames, findings)
            check_frame_files(folder, camera, f"cameras[{index}]", clock, findings)
    masks = None if findings.problems else check_masks(folder, raw["cameras"], clock, findings)
    truth, more = _examine_truth(folder, raw, frames, findings)
    return Examination(raw, truth, (*findings.problems, *more), tuple(findings.warnings), masks)


def examine_network(folder: Path) -> Examination:
    """Parse and check what a capture says of its cameras, without a look at its frames, which may be yet to come.

    `frames` may be absent, and so may a camera's `rgb`, where pictures come from elsewhere; truth is left alone.
    """
    findings = Findings("capture.json")
    raw = _load_json(folder, "capture.json", findings)
    if raw is None or not _is_known_format(raw, findings):
        return Examination(None, None, tuple(findings.problems))
    findings.mapping(raw, "", ("format", "version", "fps", "cameras"), ("frames", *OPTIONAL))
    fps = _check_clock({key: value for key, value in raw.items() if key == "fps"}, findings)[0]
    _check_missing(raw, findings)
    clock = Clock(fps, None, refuse=False, outside=_check_outside(raw, findings))
    _check_origin(raw, findings)
    listed, pictures = _cameras(raw, findings), ("rgb", *OPTIONAL_IMAGES)
    required = tuple(key for key in CAMERA_KEYS if key != "rgb")
    check_cameras(listed, findings, required, (*pictures, "time_offset_s", "mask_kind"))
    for index, camera in enumerate(listed):
        if isinstance(camera, dict):
            _check_offset(camera, f"cameras[{index}].time_offset_s", fps, None, findings)
            check_frame_files(folder, camera, f"cameras[{index}]", clock, findings)
    return Examination(raw, None, tuple(findings.problems), tuple(findings.warnings))


def _cameras(raw: dict[str, Any], findings: Findings) -> list[Any]:
    return findings.items(raw["cameras"], "cameras") if "cameras" in raw else []


def _load_json(folder: Path, name: str, findings: Findings) -> dict[str, Any] | None:
    path = folder / name
    if not path.is_file():
        findings.add("", "the file is missing", f"a capture needs {name} in {folder}", file=name)
        return None
    if path.stat().st_size > LARGEST_JSON:
        findings.add("", f"is larger than {LARGEST_JSON >> 20} MiB", "split the capture", file=name)
        return None
    duplicates: list[str] = []

    def keep_last(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = [key for key, _ in pairs]
        duplicates.extend(key for key in dict.fromkeys(keys) if keys.count(key) > 1)
        return dict(pairs)

    try:
        # From bytes, whose first ones tell UTF-8 with a byte order mark, UTF-16 and UTF-32 (RFC 4627, §3).
        raw = json.loads(path.read_bytes(), object_pairs_hook=keep_last)
    except OSError as error:
        findings.add("", f"cannot be read: {error.strerror}", "check the permissions", file=name)
        return None
    except (ValueError, RecursionError) as error:  # decoding errors and integers of absurd length are ValueErrors
        findings.add("", f"is not valid JSON: {str(error)[:160] or 'nested too deeply'}", "repair the file", file=name)
        return None
    for key in duplicates:
        findings.add(shown(key)[1:-1], "the key stands twice in one object", "delete one of them", file=name)
    if not isinstance(raw, dict):
        findings.add("", "must contain a JSON object", "write { … } around the contents", file=name)
        return None
    return raw


def _is_known_format(raw: dict[str, Any], findings: Findings) -> bool:
    """Whether the rest of the file can be understood at all."""
    if raw.get("format") != FORMAT:
        findings.add("format", f"must be {FORMAT!r}, is {shown(raw.get('format'))}", "convert the capture")
        return False
    version = raw.get("version")
    if isinstance(version, bool) or version != VERSION:
        findings.add("version", f"must be {VERSION}, is {shown(version)}", "convert the capture or update aerojax")
        return False
    return True


def _check_clock(raw: dict[str, Any], findings: Findings) -> tuple[float | None, int | None]:
    fps = findings.number(raw["fps"], "fps") if "fps" in raw else None
    if fps is not None and fps <= 0:
        findings.add("fps", f"must be positive, is {fps:g}", "write the frames per second of the capture")
    frames = findings.whole(raw["frames"], "frames", 1, MOST_FRAMES) if "frames" in raw else None
    return fps, frames


def _check_missing(raw: dict[str, Any], findings: Findings) -> str:
    chosen = raw.get("missing", "drop")
    if chosen not in MISSING:
        findings.add("missing", f"must be {' or '.join(map(repr, MISSING))}, is {shown(chosen)}", "correct the word")
    return chosen


def _check_outside(raw: dict[str, Any], findings: Findings) -> bool:
    chosen = raw.get("outside", False)
    if not isinstance(chosen, bool):
        findings.add("outside", f"must be true or false, is {shown(chosen)}", "correct the value")
    elif chosen:
        message = "files may lie outside of the capture's folder, as capture.json asks for"
        findings.warn("outside", message, "open such captures only from sources that you trust")
    return chosen is True


def _check_origin(raw: dict[str, Any], findings: Findings) -> None:
    if "origin" not in raw:
        return
    origin = findings.mapping(raw["origin"], "origin", ("latitude", "longitude", "height"))
    limits = {"latitude": 90.0, "longitude": 180.0, "height": 20_000.0}
    for key in limits.keys() & (origin or {}).keys():
        value = findings.number((origin or {})[key], f"origin.{key}")
        if value is not None and abs(value) > limits[key]:
            findings.add(f"origin.{key}", f"{value:g} is beyond ±{limits[key]:g}", "write degrees and metres (WGS 84)")


def _check_offset(
    camera: dict[str, Any], field: str, fps: float | None, frames: int | None, findings: Findings
) -> None:
    offset = findings.number(camera["time_offset_s"], field) if "time_offset_s" in camera else None
    if offset is not None and fps is not None and frames is not None and abs(offset) * fps >= frames:
        message = f"{offset:g} s is longer than the capture, so that the camera shares no moment with it"
        findings.add(field, message, "correct the offset (seconds) or drop the camera")


@dataclass(frozen=True)
class _Placed:
    field: str
    name: str | None
    centre: np.ndarray | None


def check_cameras(listed: list[Any], findings: Findings, required: tuple[str, ...], optional: tuple[str, ...]) -> None:
    """Names, sizes, lenses and poses of a network's cameras; of other keys, whether they may and must be there."""
    _check_network(
        [_check_camera(one, f"cameras[{i}]", findings, required, optional) for i, one in enumerate(listed)], findings
    )


def _check_camera(
    camera: Any, field: str, findings: Findings, required: tuple[str, ...], optional: tuple[str, ...]
) -> _Placed:
    camera = findings.mapping(camera, field, required, optional)
    if camera is None:
        return _Placed(field, None, None)
    name = findings.text(camera["name"], f"{field}.name") if "name" in camera else None
    for side in ("width", "height"):
        if side in camera:
            findings.whole(camera[side], f"{field}.{side}", 1, LARGEST_SIDE)
    K = findings.matrix(camera["K"], f"{field}.K", 3) if "K" in camera else None
    if K is not None:
        _check_intrinsics(K, f"{field}.K", findings)
    if "distortion" in camera:
        _check_distortion(camera["distortion"], K, f"{field}.distortion", findings)
    transform = None
    if "world_from_cam" in camera:
        transform = findings.matrix(camera["world_from_cam"], f"{field}.world_from_cam", 4)
    if transform is not None:
        _check_rigid(transform, f"{field}.world_from_cam", findings)
    return _Placed(field, name, None if transform is None else transform[:3, 3])


def _check_intrinsics(K: np.ndarray, field: str, findings: Findings) -> None:
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        findings.add(field, f"focal lengths must be positive, are {K[0, 0]:g} and {K[1, 1]:g}", "recalibrate")
    if not np.array_equal(K[2], [0, 0, 1]) or K[1, 0] != 0:
        findings.add(field, "must be [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]", "correct the matrix; is it transposed?")


def _check_rigid(transform: np.ndarray, field: str, findings: Findings) -> None:
    rotation = transform[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        residual = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if not np.array_equal(transform[3], [0, 0, 0, 1]):
        findings.add(field, "the last row must be 0 0 0 1", "correct the matrix; is it transposed?")
    if not residual <= ROUNDED_ROTATION:
        findings.add(field, f"the rotation is not orthonormal (off by {residual:.2g})", "remove scale and shear")
    elif np.linalg.det(rotation) < 0:
        findings.add(field, "the rotation is a reflection (determinant -1)", "use right-handed OpenCV axes")
    elif residual > EXACT_ROTATION:
        message = f"the rotation is off by {residual:.2g} and was made orthonormal"
        findings.warn(field, message, "write it with more digits")


def _check_distortion(distortion: Any, K: np.ndarray | None, field: str, findings: Findings) -> None:
    distortion = findings.mapping(distortion, field, ("model", "coefficients"))
    if distortion is None or not {"model", "coefficients"} <= set(distortion):
        return
    model, coefficients = distortion["model"], distortion["coefficients"]
    if not isinstance(model, str) or model not in COEFFICIENT_COUNTS:
        findings.add(f"{field}.model", f"unknown model {shown(model)}", f"use {', '.join(COEFFICIENT_COUNTS)}")
        return
    counts = COEFFICIENT_COUNTS[model]
    if not isinstance(coefficients, list) or len(coefficients) not in counts:
        found = f"{len(coefficients)} coefficients" if isinstance(coefficients, list) else shown(coefficients)
        wanted = " or ".join(map(str, counts))
        findings.add(f"{field}.coefficients", f"{model} takes a list of {wanted} coefficients, found {found}", "fix it")
        return
    findings.numbers(coefficients, f"{field}.coefficients", len(coefficients))
    if model != "none" and K is not None and K[0, 1] != 0:
        findings.add(field, "a lens model cannot be combined with skew in K", "set K[0][1] to 0 or undistort first")


def _check_network(cameras: list[_Placed], findings: Findings) -> None:
    if 0 < len(cameras) < FEWEST_CAMERAS or (not cameras and not findings.problems):
        findings.add("cameras", f"{len(cameras)} found, at least {FEWEST_CAMERAS} are needed", "add cameras")
    for i, camera in enumerate(cameras):
        for other in cameras[:i]:
            if camera.name is not None and camera.name == other.name:
                findings.add(f"{camera.field}.name", f"{shown(camera.name)} is also {other.field}", "rename one camera")
            if camera.centre is not None and other.centre is not None:
                with np.errstate(over="ignore"):
                    apart = math.hypot(*(camera.centre - other.centre))
                if apart < _SAME_CENTRE:
                    message = f"same centre as {other.field}; two such views give no depth"
                    findings.add(f"{camera.field}.world_from_cam", message, "recalibrate or drop one camera")


def _examine_truth(
    folder: Path, raw: dict[str, Any], frames: int | None, findings: Findings
) -> tuple[dict[str, Any] | None, tuple[Problem, ...]]:
    name = raw.get("truth")
    if name is None:
        return None, ()
    if not isinstance(name, str):
        findings.add("truth", f"must be the name of a file, is {shown(name)}", "correct the name or delete the key")
        return None, ()
    outside = relative_path_problem(name)
    if outside or not is_inside(folder, folder / name):
        findings.add("truth", f"{shown(name)} {outside or 'links out of the folder'}", "put the file into the folder")
        return None, ()
    in_truth = Findings(name)
    truth = _load_json(folder, name, in_truth)
    listed = raw.get("cameras")
    cameras = [c.get("name") for c in listed if isinstance(c, dict)] if isinstance(listed, list) else []
    if truth is not None:
        check_truth(truth, [c for c in cameras if isinstance(c, str)], frames, in_truth)
    return truth, tuple(in_truth.problems)
