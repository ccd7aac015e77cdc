"""nerfstudio: `transforms.json` of a whole sequence and `transforms_<frame>.json` of each instant.

`transform_matrix` is camera-to-world with OpenGL axes (+x right, +y up, looking along -z) in the capture's world (+Z
up, metres). nerfstudio samples pixel (i, j) at (i + 0.5, j + 0.5), so cx and cy are the capture's. Depth is float32
.npy in millimetres, since its loader multiplies by 0.001 unless told otherwise; 0 = none. Masks are 255 where an object
is. `time` runs from 0 to 1 over the sequence. Its parser turns and scales worlds by default: pass
`--orientation-method none --center-method none --auto-scale-poses False` to keep metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aerojax.capture.format import Capture
from aerojax.capture.frames import read_depth
from aerojax.core.array_files import write_array
from aerojax.core.files import write_json
from aerojax.data.exports.images import place_image, place_mask, recorded_frames
from aerojax.data.exports.sources import ExportOptions, SourceSequence, camera_names, require_no_skew

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
"""Camera axes: +y and +z change sign; its own inverse."""

_MILLIMETRES = np.float32(1000.0)


def write_sequence(capture: Capture, sequence: SourceSequence, folder: Path, options: ExportOptions) -> dict[str, Any]:
    """Write images, masks, depths and the transforms of one sequence."""
    require_no_skew(capture, "nerfstudio")
    target = folder / sequence.split / sequence.name
    records = []
    for camera_index, name in enumerate(camera_names(capture)):
        for frame in recorded_frames(capture, camera_index):
            records.append(_record(capture, camera_index, frame, target, f"{name}/{frame:06d}", options))
    records.sort(key=lambda record: record["frame_index"])
    _write_transforms(target / "transforms.json", records)
    for frame in sorted({record["frame_index"] for record in records}):
        instant = [record for record in records if record["frame_index"] == frame]
        _write_transforms(target / f"transforms_{frame:06d}.json", instant)
    return {}


def _record(
    capture: Capture, camera_index: int, frame: int, target: Path, stem: str, options: ExportOptions
) -> dict[str, Any]:
    camera = capture.cameras[camera_index]
    image = place_image(capture, camera_index, frame, target / "images" / stem, options.images)
    record: dict[str, Any] = {
        "file_path": image.relative_to(target).as_posix(),
        "transform_matrix": (camera.world_from_cam @ OPENGL_FROM_OPENCV).tolist(),
        "fl_x": float(camera.K[0, 0]),
        "fl_y": float(camera.K[1, 1]),
        "cx": float(camera.K[0, 2]),
        "cy": float(camera.K[1, 2]),
        "w": camera.width,
        "h": camera.height,
        "time": frame / max(capture.frames - 1, 1),
        "frame_index": frame,
        "camera": camera.name,
    }
    mask_path = f"masks/{stem}.png"
    if place_mask(capture, camera_index, frame, target / mask_path):
        record["mask_path"] = mask_path
    depth = read_depth(capture, camera_index, frame) if options.depth else None
    if depth is not None:
        record["depth_file_path"] = f"depth/{stem}.npy"
        write_array(target / record["depth_file_path"], depth * _MILLIMETRES)
    return record


def _write_transforms(path: Path, records: list[dict[str, Any]]) -> None:
    content = {"camera_model": "OPENCV", "k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0, "frames": records}
    write_json(path, content)


def finish(folder: Path, parts: Sequence[Path]) -> None:
    """Sequences stand alone: nothing is merged."""
