"""COCO instances: `annotations/instances_<split>.json` and `images/<split>/`.

Beyond COCO's own keys, images carry `sequence`, `camera`, `frame`, `fps`, `K` and `world_from_cam`, annotations
`track_id` (one for an object in all cameras and frames of a sequence), `instance_id` (its value in the capture's
masks), `identity` and, where known, `visibility`, `truncated` and `amodal_bbox` (of the whole object, hidden parts and
those beyond the image included). Boxes are x, y, width, height of whole pixels. Where the truth has them, there are
also `bbox_3d` (`centre` and `size` in metres, `orientation_wxyz`; world frame, `size` along the box's own axes),
`bbox_3d_aligned` (`low` and `high`, along the world's axes) and `bbox_3d_corners` (the eight corners of the first as
u, v in pixels; z changes fastest, then y, then x).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from aerojax.capture.format import Capture
from aerojax.capture.frames import read_mask
from aerojax.core.errors import UserError
from aerojax.core.files import whole_file
from aerojax.core.types import CLASSES
from aerojax.data.exports.annotations import Annotation, image_annotations, object_pixels
from aerojax.data.exports.images import place_image, recorded_frames
from aerojax.data.exports.run_length import encode_mask
from aerojax.data.exports.sources import ExportOptions, SourceSequence, camera_names, stable_id

CATEGORIES = [
    {"id": index + 1, "name": name, "supercategory": "flying object", "isthing": 1}
    for index, name in enumerate(CLASSES)
]


def write_sequence(
    capture: Capture, sequence: SourceSequence, folder: Path, options: ExportOptions
) -> dict[str, list[dict[str, Any]]]:
    """Place the images of one sequence and return its image and annotation records."""
    part: dict[str, list[dict[str, Any]]] = {"images": [], "annotations": []}
    for camera_index, camera_name in enumerate(camera_names(capture)):
        for frame in recorded_frames(capture, camera_index):
            target = folder / "images" / sequence.split / f"{sequence.name}__{camera_name}__{frame:06d}"
            path = place_image(capture, camera_index, frame, target, options.images)
            image = _image(capture, sequence, camera_index, frame) | {"file_name": path.name}
            part["images"].append(image)
            part["annotations"] += _annotations(capture, sequence, camera_index, frame, image["id"])
    return part


def _image(capture: Capture, sequence: SourceSequence, camera_index: int, frame: int) -> dict[str, Any]:
    camera = capture.cameras[camera_index]
    return {
        "id": stable_id(sequence.split, sequence.name, camera.name, frame),
        "width": camera.width,
        "height": camera.height,
        "sequence": sequence.name,
        "camera": camera.name,
        "frame": frame,
        "fps": capture.fps,
        "K": camera.K.tolist(),
        "world_from_cam": camera.world_from_cam.tolist(),
    }


def _annotations(
    capture: Capture, sequence: SourceSequence, camera_index: int, frame: int, image_id: int
) -> Iterator[dict[str, Any]]:
    mask = read_mask(capture, camera_index, frame)
    for seen in image_annotations(capture, camera_index, frame):
        pixels = object_pixels(mask, seen)
        x0, y0, x1, y1 = seen.box
        area = (x1 - x0) * (y1 - y0) if pixels is None else int(pixels.sum())
        yield {
            "id": stable_id(image_id, seen.item.object_id),
            "image_id": image_id,
            "category_id": CLASSES.index(seen.item.class_name) + 1,
            "bbox": [x0, y0, x1 - x0, y1 - y0],
            "area": area,
            "iscrowd": 0,
            "segmentation": [] if pixels is None else encode_mask(pixels),
            "track_id": stable_id(sequence.split, sequence.name, seen.item.object_id),
            "instance_id": seen.item.object_id,
            "identity": seen.item.identity,
            **_optional(seen),
        }


def _optional(seen: Annotation) -> dict[str, Any]:
    whole = None
    if seen.whole_box is not None:
        x0, y0, x1, y1 = seen.whole_box
        whole = [x0, y0, x1 - x0, y1 - y0]
    known = {"visibility": seen.visibility, "truncated": seen.truncated, "amodal_bbox": whole}
    known |= _in_space(seen)
    return {key: value for key, value in known.items() if value is not None}


def _in_space(seen: Annotation) -> dict[str, Any]:
    oriented, aligned = seen.state.oriented_box, seen.state.aligned_box
    turned = {"orientation_wxyz": seen.state.orientation_wxyz}
    return {
        "bbox_3d": None if oriented is None else asdict(oriented) | turned,
        "bbox_3d_aligned": None if aligned is None else asdict(aligned),
        "bbox_3d_corners": seen.state.projected_corners.get(seen.camera),
    }


def finish(folder: Path, parts: Sequence[Path]) -> None:
    """Merge the sequences' records into one file a split, holding one sequence in memory at a time."""
    for split in dict.fromkeys(part.parent.name for part in parts):
        mine = [part for part in parts if part.parent.name == split]
        path = folder / "annotations" / f"instances_{split}.json"
        with whole_file(path) as temporary, temporary.open("w", encoding="utf-8") as file:
            head = {"info": {"description": f"aerojax, split {split}", "version": "1.0"}, "licenses": []}
            file.write(json.dumps(head)[:-1] + f', "categories": {json.dumps(CATEGORIES)}')
            for kind in ("images", "annotations"):
                _merge(file, kind, mine)
            file.write("}\n")


def _merge(file: TextIO, kind: str, parts: Sequence[Path]) -> None:
    seen: set[int] = set()
    file.write(f', "{kind}": [')
    for part in parts:
        for record in json.loads(part.read_text(encoding="utf-8"))[kind]:
            if record["id"] in seen:  # about one in ten thousand for a million images
                raise UserError(
                    "mismatch", f"{part.stem}: two {kind} have the id {record['id']}", "rename the sequence"
                )
            file.write((",\n" if seen else "\n") + json.dumps(record))
            seen.add(record["id"])
    file.write("]")
