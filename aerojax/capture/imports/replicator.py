"""Isaac Replicator recordings of several static cameras as captures."""

from __future__ import annotations

import dataclasses
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float32, UInt16

from aerojax.capture.format import Capture, CaptureCamera, Truth, read_capture, write_capture_json
from aerojax.capture.imports.recording import (
    BrokenFile,
    RecordedCamera,
    read_colour,
    read_json,
    read_plane_depth,
    read_segments,
    scan_recording,
)
from aerojax.capture.imports.replicator_camera import RecordedPinhole, UpAxis, parse_camera
from aerojax.capture.imports.replicator_objects import FlyingPrims, find_flying_prims, read_mapping
from aerojax.capture.imports.replicator_truth import Poses, Sight, look_at_object, read_poses, tracked_objects
from aerojax.capture.paths import safe_name
from aerojax.capture.validate.examination import FEWEST_CAMERAS
from aerojax.capture.validate.findings import Findings, Problem, refuse
from aerojax.capture.write import write_frame
from aerojax.core.errors import UserError

_STILL = 1e-6  # pixels and metres; a static camera's parameters are written equal
_DEPTHS = {"distance_to_image_plane": False, "distance_to_camera": True}
"""Kinds of depth, the better one first, and whether distances run along the rays."""
_IMAGES = ("rgb", "instance_segmentation", *_DEPTHS)
"""What every frame must have where one has; mappings are missed with their image, the rest may be rare."""


@dataclass(frozen=True)
class ReplicatorImport:
    """What a recording does not say.

    fps: frames per second.
    classes: class of a label or prim path; None where it is scenery. Labels that are classes need no word.
    up: the stage's up axis.
    """

    fps: float
    classes: Mapping[str, str | None] = field(default_factory=dict)
    up: UpAxis = "z"


@dataclass(frozen=True, eq=False)
class _Source:
    """One camera of the recording.

    recorded: its files.
    camera: the capture's.
    ray_lengths: of each pixel's ray with z = 1.
    depth: which of `_DEPTHS` it has, or None.
    unit: metres a stage unit.
    """

    recorded: RecordedCamera
    camera: CaptureCamera
    ray_lengths: Float32[np.ndarray, "height width"]
    depth: str | None
    unit: float


def import_replicator(
    recording: Path,
    out: Path,
    settings: ReplicatorImport,
    *,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Capture:
    """Turn a recording of BasicWriter (rgb, camera_params, instance_segmentation, distances) into a capture.

    Distances are metres in every stage, camera poses stage units. 3D boxes (bounding_box_3d), where recorded, give the
    poses of objects; otherwise positions are estimates (`imports.replicator_truth`).

    Args:
        recording: folder with a folder a render product.
        out: becomes the capture; must not exist. It appears when it is complete.
        settings: frame rate, classes and up axis.
        progress: called after each frame with (done, total, what).

    Raises:
        UserError: lists every problem of the recording at once, each with file, field and remedy.
    """
    if out.exists():
        raise UserError("out-of-range", f"out={out} exists already", "choose another folder")
    if not settings.fps > 0:
        raise UserError(
            "out-of-range", f"fps={settings.fps:g} must be positive", "give the recording's frames per second"
        )
    problems: list[Problem] = []
    recorded = scan_recording(recording)
    frames = _common_frames(recording, recorded, problems)
    flying = find_flying_prims(recorded, settings.classes, problems)
    sources = [_source(camera, settings.up, problems) for camera in recorded]
    _refuse_if(problems, recording)
    out.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(dir=out.parent, prefix=f".{out.name}-"))
    temporary.chmod(0o755)
    try:
        whole = [source for source in sources if source is not None]
        capture = _convert(whole, frames, flying, settings, temporary, problems, progress)
        _refuse_if(problems, recording)
        write_capture_json(capture)
        read_capture(temporary)  # whatever else is wrong with the network is said before the capture appears
        temporary.replace(out)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return dataclasses.replace(capture, folder=out)


def _refuse_if(problems: Sequence[Problem], recording: Path) -> None:
    """Name files by their place in the recording."""
    inside = (Path(problem.file) for problem in problems)
    names = [str(path.relative_to(recording) if path.is_relative_to(recording) else path) for path in inside]
    placed = [dataclasses.replace(problem, file=name) for problem, name in zip(problems, names, strict=True)]
    refuse(placed, f"recording {recording}")


def _common_frames(recording: Path, cameras: Sequence[RecordedCamera], problems: list[Problem]) -> list[int]:
    """The frame numbers that all cameras must have, in order and without gaps."""
    if len(cameras) < FEWEST_CAMERAS:
        remedy = "name the folder above the render products' folders, with rgb_*.png or rgb/rgb_*.png in each"
        message = f"{len(cameras)} cameras found, a capture needs at least {FEWEST_CAMERAS}"
        problems.append(Problem(str(recording), "", message, remedy))
    frames = sorted({frame for camera in cameras for frame in camera.files.get("rgb", {})})
    if frames and len(frames) != frames[-1] - frames[0] + 1:
        problems.append(Problem(str(recording), "", "its frame numbers have gaps", "copy the recording whole"))
    for camera in cameras:
        for kind in (kind for kind in _IMAGES if kind in camera.files):
            lacking = [frame for frame in frames if frame not in camera.files[kind]]
            if lacking:
                message = f"{kind} lacks {len(lacking)} of {len(frames)} frames, the first is {lacking[0]}"
                problems.append(Problem(str(recording / camera.name), "", message, "copy the recording whole"))
    return frames


def _source(recorded: RecordedCamera, up: UpAxis, problems: list[Problem]) -> _Source | None:
    """One camera; problems are noted, among them a camera that moves."""
    pinhole: RecordedPinhole | None = None
    files = recorded.files.get("camera_params", {})
    if not files:
        problems.append(Problem(recorded.name, "", "has no camera_params", "record with camera_params=True"))
    for path in files.values():
        found = Findings(str(path))
        try:
            other = parse_camera(read_json(path), up, found)
        except BrokenFile as broken:
            problems.append(broken.problem)
            continue
        problems.extend(found.problems)
        if other is None:
            return None  # one file's problems are enough: the others' are the same
        pinhole = pinhole or other
        if not _same(pinhole, other):
            remedy = "record with static cameras; a capture has one pose a camera"
            problems.append(Problem(str(path), "", "the camera has moved since the first frame", remedy))
            return None
    return None if pinhole is None else _static_source(recorded, pinhole)


def _same(one: RecordedPinhole, other: RecordedPinhole) -> bool:
    close = np.allclose(one.K, other.K, atol=_STILL, rtol=0)
    close = close and np.allclose(one.world_from_cam, other.world_from_cam, atol=_STILL, rtol=0)
    return close and (one.width, one.height) == (other.width, other.height)


def _static_source(recorded: RecordedCamera, pinhole: RecordedPinhole) -> _Source:
    name = safe_name(recorded.name)
    depth = next((kind for kind in _DEPTHS if kind in recorded.files), None)
    masks = "instance_segmentation" in recorded.files
    camera = CaptureCamera(
        name=name,
        width=pinhole.width,
        height=pinhole.height,
        K=pinhole.K,
        distortion_model="none",
        distortion=(),
        world_from_cam=pinhole.world_from_cam,
        rgb=f"{name}/rgb/{{frame:06d}}.png",
        mask=f"{name}/mask/{{frame:06d}}.png" if masks else None,
        depth=f"{name}/depth/{{frame:06d}}.tiff" if depth else None,
        time_offset_s=0.0,
    )
    u, v = np.meshgrid(np.arange(pinhole.width) + 0.5, np.arange(pinhole.height) + 0.5)
    K = pinhole.K
    lengths = np.sqrt(((u - K[0, 2]) / K[0, 0]) ** 2 + ((v - K[1, 2]) / K[1, 1]) ** 2 + 1)
    return _Source(recorded, camera, lengths.astype(np.float32), depth, pinhole.unit)


def _convert(
    sources: Sequence[_Source],
    frames: Sequence[int],
    flying: FlyingPrims,
    settings: ReplicatorImport,
    folder: Path,
    problems: list[Problem],
    progress: Callable[[int, int, str], None],
) -> Capture:
    """Write all frames; broken files are noted and left out."""
    sights: dict[tuple[int, int], dict[str, Sight]] = {}
    poses: Poses = {}
    for index, frame in enumerate(frames):
        for source in sources:
            try:
                for number, sight in _convert_image(source, frame, index, flying, folder).items():
                    sights.setdefault((number, index), {})[source.camera.name] = sight
                for number, pose in read_poses(source.recorded, frame, flying, settings.up, source.unit).items():
                    poses.setdefault(number, {})[index] = pose
            except BrokenFile as broken:
                problems.append(broken.problem)
        progress(index + 1, len(frames), "frames")
    cameras = tuple(source.camera for source in sources)
    objects = tracked_objects(flying, sights, poses, cameras, len(frames))
    has_masks = any(camera.mask is not None for camera in cameras)
    return Capture(folder, settings.fps, len(frames), cameras, Truth(objects) if has_masks else None)


def _convert_image(source: _Source, frame: int, index: int, flying: FlyingPrims, folder: Path) -> dict[int, Sight]:
    """Write one camera's frame and say what it shows, by object id."""
    rgb_path = source.recorded.at("rgb", frame)
    assert rgb_path is not None, "checked with the frames"
    rgb = read_colour(rgb_path)
    if rgb.shape[:2] != source.ray_lengths.shape:
        height, width = source.ray_lengths.shape
        raise BrokenFile(rgb_path, f"is {rgb.shape[1]}×{rgb.shape[0]} pixels, camera_params says {width}×{height}")
    depth = None
    if source.depth is not None:
        depth_path = source.recorded.at(source.depth, frame)
        assert depth_path is not None, "checked with the frames"
        depth = read_plane_depth(depth_path, from_centre=_DEPTHS[source.depth], ray_lengths=source.ray_lengths)
    mask = _mask(source, frame, flying) if source.camera.mask is not None else None
    write_frame(folder, source.camera, index, rgb, mask, depth)
    if mask is None:
        return {}
    seen = {int(number): look_at_object(mask == number, depth, source.camera) for number in np.unique(mask[mask > 0])}
    return {number: sight for number, sight in seen.items() if sight is not None}


def _mask(source: _Source, frame: int, flying: FlyingPrims) -> UInt16[np.ndarray, "height width"]:
    path = source.recorded.at("instance_segmentation", frame)
    assert path is not None, "checked with the frames"
    numbers = read_segments(path)
    if numbers.shape != source.ray_lengths.shape:
        raise BrokenFile(path, f"is {numbers.shape}, the image is {source.ray_lengths.shape}")
    mask = np.zeros(numbers.shape, np.uint16)
    for segment in read_mapping(source.recorded, frame):
        object_id = flying.object_id(segment.prim)
        if object_id is not None:
            mask[numbers == segment.number] = object_id
    return mask
