"""Isaac Replicator's BasicWriter: `<split>/<sequence>/<camera>/<annotator>/<annotator>_0000.*`.

Annotators: rgb, instance_segmentation (16-bit ids, not colourised; 0 = BACKGROUND, 1 = UNLABELLED, else the object's id
plus 1), distance_to_image_plane (metres, infinite where there is nothing), normals (8-bit (n + 1)/2 of the world's
normals, black where there is none; where the capture has them), bounding_box_2d_tight (x_max and y_max are
the last pixel; occlusionRatio -1 where unknown), bounding_box_3d (where every visible object has such a box: its ends
in the body's frame and world-from-body, metres) and camera_params. Its matrices act on row vectors and its camera has
OpenGL axes: `reshape(4, 4).T` of cameraViewTransform is camera-from-world, whatever its own doc string says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.capture.frames import read_depth, read_mask, read_normal
from aerojax.core.array_files import write_array
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.data.exports.annotations import Annotation, image_annotations
from aerojax.data.exports.images import place_image, recorded_frames, write_sparse_png
from aerojax.data.exports.nerfstudio import OPENGL_FROM_OPENCV
from aerojax.data.exports.sources import (
    ExportOptions,
    SourceSequence,
    camera_names,
    require_no_skew,
)
from aerojax.geometry.boxes_3d import OrientedBox
from aerojax.geometry.cameras import invert_rigid

BOX_TYPE = np.dtype(
    [
        ("semanticId", "<u4"),
        *((side, "<i4") for side in ("x_min", "y_min", "x_max", "y_max")),
        ("occlusionRatio", "<f4"),
    ]
)
BOX_3D_TYPE = np.dtype(
    [
        ("semanticId", "<u4"),
        *((end, "<f4") for end in ("x_min", "y_min", "z_min", "x_max", "y_max", "z_max")),
        ("transform", "<f4", (4, 4)),
        ("occlusionRatio", "<f4"),
    ]
)
FIRST_ID = 2
"""Ids below are BACKGROUND and UNLABELLED."""
_LARGEST_PIXEL = 65_535
_APERTURE_MM = 20.955  # USD's default horizontal aperture
_NEAR_FAR = (0.01, 1_000_000.0)  # metres


@dataclass(frozen=True)
class _Folder:
    """Where one camera's files go: `path(annotator, file)`."""

    root: Path
    nested: bool

    def path(self, annotator: str, stem: str, frame: int, suffix: str) -> Path:
        folder = self.root / annotator if self.nested else self.root
        folder.mkdir(parents=True, exist_ok=True)
        return folder / f"{stem}_{frame:04d}{suffix}"

    def write_annotation(self, annotator: str, stem: str, frame: int, content: Any) -> None:
        write_json(self.path(annotator, stem, frame, ".json"), content, indent=None)


def write_sequence(capture: Capture, sequence: SourceSequence, folder: Path, options: ExportOptions) -> dict[str, Any]:
    """Write one sequence as BasicWriter would have, a folder a camera."""
    require_no_skew(capture, "Replicator")
    for camera_index, name in enumerate(camera_names(capture)):
        files = _Folder(folder / sequence.split / sequence.name / name, options.replicator_layout == "nested")
        parameters = camera_parameters(capture.cameras[camera_index])
        for frame in recorded_frames(capture, camera_index):
            rgb = files.path("rgb", "rgb", frame, "")
            place_image(capture, camera_index, frame, rgb, options.images, suffixes=(".png",))
            files.write_annotation("camera_params", "camera_params", frame, parameters)
            _write_segmentation(capture, camera_index, frame, files)
            _write_boxes(list(image_annotations(capture, camera_index, frame)), files, frame)
            _write_normals(capture, camera_index, frame, files)
            depth = read_depth(capture, camera_index, frame) if options.depth else None
            if depth is not None:
                kind = "distance_to_image_plane"
                write_array(files.path(kind, kind, frame, ".npy"), np.where(depth > 0, depth, np.float32(np.inf)))
    return {}


def prim_path(object_id: int, class_name: str) -> str:
    """The prim that an object is said to be; sorted paths are in order of id."""
    return f"/World/object_{object_id:05d}_{class_name}"


def _write_segmentation(capture: Capture, camera_index: int, frame: int, files: _Folder) -> None:
    mask = read_mask(capture, camera_index, frame)
    if mask is None or capture.truth is None:
        return
    largest = int(mask.max())
    if largest + FIRST_ID - 1 > _LARGEST_PIXEL:
        raise UserError(
            "mismatch", f"{capture.folder}: object id {largest} does not fit beside Replicator's own two", "renumber it"
        )
    kind = "instance_segmentation"
    shifted = np.where(mask > 0, mask + np.uint16(FIRST_ID - 1), np.uint16(0))
    write_sparse_png(files.path(kind, kind, frame, ".png"), shifted)
    names = {"0": "BACKGROUND", "1": "UNLABELLED"}
    present = [o for o in capture.truth.objects if np.any(mask == o.object_id)]
    paths = {str(o.object_id + FIRST_ID - 1): prim_path(o.object_id, o.class_name) for o in present}
    labels = {str(o.object_id + FIRST_ID - 1): {"class": o.class_name} for o in present}
    files.write_annotation(kind, f"{kind}_mapping", frame, names | paths)
    semantics = {number: {"class": name} for number, name in names.items()} | labels
    files.write_annotation(kind, f"{kind}_semantics_mapping", frame, semantics)


def _write_normals(capture: Capture, camera_index: int, frame: int, files: _Folder) -> None:
    normal = read_normal(capture, camera_index, frame)
    if normal is None:
        return
    colour = np.where(normal.any(axis=-1, keepdims=True), np.round((normal + 1) * 127.5), 0.0).astype(np.uint8)
    write_sparse_png(files.path("normals", "normals", frame, ".png"), colour)


def _write_boxes(seen: list[Annotation], files: _Folder, frame: int) -> None:
    classes = sorted({annotation.item.class_name for annotation in seen})
    rows = []
    for annotation in seen:
        x0, y0, x1, y1 = annotation.box
        corners = int(np.floor(x0)), int(np.floor(y0)), int(np.ceil(x1)) - 1, int(np.ceil(y1)) - 1
        rows.append((classes.index(annotation.item.class_name), *corners, _hidden(annotation)))
    _write_rows("bounding_box_2d_tight", np.array(rows, dtype=BOX_TYPE), seen, classes, files, frame)
    known = [(annotation, annotation.state.oriented_box) for annotation in seen]
    solid = [_box_3d(annotation, box, classes) for annotation, box in known if box is not None]
    if seen and len(solid) == len(seen):
        _write_rows("bounding_box_3d", np.array(solid, dtype=BOX_3D_TYPE), seen, classes, files, frame)


def _write_rows(
    kind: str, rows: np.ndarray, seen: list[Annotation], classes: list[str], files: _Folder, frame: int
) -> None:
    write_array(files.path(kind, kind, frame, ".npy"), rows)
    files.write_annotation(kind, f"{kind}_labels", frame, {str(i): {"class": name} for i, name in enumerate(classes)})
    paths = [prim_path(o.item.object_id, o.item.class_name) for o in seen]
    files.write_annotation(kind, f"{kind}_prim_paths", frame, paths)


def _hidden(annotation: Annotation) -> float:
    return -1.0 if annotation.visibility is None else 1.0 - annotation.visibility


def _box_3d(annotation: Annotation, box: OrientedBox, classes: list[str]) -> tuple[Any, ...]:
    """One row of bounding_box_3d; its matrix acts on row vectors, as all of Replicator's do."""
    state = annotation.state
    w, x, y, z = state.orientation_wxyz
    rotation = Rotation.from_quat([x, y, z, w]).as_matrix()
    middle, half = (np.array(box.centre) - np.array(state.position)) @ rotation, np.array(box.size) / 2
    world_from_body = np.eye(4)
    world_from_body[:3, :3], world_from_body[:3, 3] = rotation, state.position
    ends = (*(middle - half).tolist(), *(middle + half).tolist())
    return classes.index(annotation.item.class_name), *ends, world_from_body.T, _hidden(annotation)


def camera_parameters(camera: CaptureCamera) -> dict[str, Any]:
    """The content of camera_params for a pinhole camera of any principal point; lengths in millimetres.

    USD's aperture offsets move the film window: the axis meets the image at u = W/2 - W·offset/aperture and, as the
    window's y points up, v = H/2 + H·offset/aperture. The projection has reversed depth, as RTX renders.
    """
    (fx, _, cx), (_, fy, cy) = camera.K[0].tolist(), camera.K[1].tolist()
    width, height, near, far = camera.width, camera.height, *_NEAR_FAR
    tall = _APERTURE_MM * height / width * fx / fy
    depth = near / (far - near)
    projection = [
        [2 * fx / width, 0.0, 0.0, 0.0],
        [0.0, 2 * fy / height, 0.0, 0.0],
        [1 - 2 * cx / width, 2 * cy / height - 1, depth, -1.0],
        [0.0, 0.0, depth * far, 0.0],
    ]
    view = (OPENGL_FROM_OPENCV @ invert_rigid(camera.world_from_cam)).T
    return {
        "cameraAperture": [_APERTURE_MM, tall],
        "cameraApertureOffset": [_APERTURE_MM * (0.5 - cx / width), tall * (cy / height - 0.5)],
        "cameraFisheyeLensP": [],
        "cameraFisheyeLensS": [],
        "cameraFisheyeMaxFOV": 0.0,
        "cameraFisheyeNominalHeight": 0,
        "cameraFisheyeNominalWidth": 0,
        "cameraFisheyeOpticalCentre": [0.0, 0.0],
        "cameraFisheyePolynomial": [0.0, 0.0, 0.0, 0.0, 0.0],
        "cameraFocalLength": fx * _APERTURE_MM / width,
        "cameraFocusDistance": 0.0,
        "cameraFStop": 0.0,
        "cameraModel": "pinhole",
        "cameraNearFar": list(_NEAR_FAR),
        "cameraProjection": [number for row in projection for number in row],
        "cameraViewTransform": view.ravel().tolist(),
        "metersPerSceneUnit": 1.0,
        "renderProductResolution": [width, height],
    }


def finish(folder: Path, parts: Sequence[Path]) -> None:
    """Recordings stand alone: nothing is merged."""
