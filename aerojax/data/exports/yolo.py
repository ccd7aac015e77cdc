"""YOLO detection: `images/<split>/`, `labels/<split>/` and `data.yaml`.

A label line is class, centre x, centre y, width, height, as shares of the image; an image without objects has an empty
file, which trains as background. `data.yaml` names no root, so that it is the folder it lies in.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from aerojax.capture.format import Capture
from aerojax.core.files import write_text
from aerojax.core.types import CLASSES
from aerojax.data.exports.annotations import image_annotations
from aerojax.data.exports.images import place_image, recorded_frames
from aerojax.data.exports.sources import ExportOptions, SourceSequence, camera_names


def write_sequence(capture: Capture, sequence: SourceSequence, folder: Path, options: ExportOptions) -> dict[str, Any]:
    """Place the images of one sequence and write their labels."""
    labels = folder / "labels" / sequence.split
    for camera_index, camera_name in enumerate(camera_names(capture)):
        for frame in recorded_frames(capture, camera_index):
            name = f"{sequence.name}__{camera_name}__{frame:06d}"
            place_image(capture, camera_index, frame, folder / "images" / sequence.split / name, options.images)
            write_text(labels / f"{name}.txt", _label_lines(capture, camera_index, frame))
    return {}


def _label_lines(capture: Capture, camera_index: int, frame: int) -> str:
    camera = capture.cameras[camera_index]
    text = ""
    for seen in image_annotations(capture, camera_index, frame):
        x0, y0, x1, y1 = seen.box
        centre = (x0 + x1) / (2 * camera.width), (y0 + y1) / (2 * camera.height)
        size = (x1 - x0) / camera.width, (y1 - y0) / camera.height
        text += f"{CLASSES.index(seen.item.class_name)} " + " ".join(f"{v:.8f}" for v in (*centre, *size)) + "\n"
    return text


def finish(folder: Path, parts: Sequence[Path]) -> None:
    """Write `data.yaml`; trainers demand `train` and `val`, so a missing one points at what there is."""
    splits = list(dict.fromkeys(part.parent.name for part in parts))
    train = "train" if "train" in splits else splits[0]
    val = next((split for split in ("val", "test") if split in splits), train)
    lines = [f"train: images/{train}", f"val: images/{val}"]
    lines += [f"{split}: images/{split}" for split in splits if split not in ("train", "val")]
    lines += [f"nc: {len(CLASSES)}", "names:", *(f"  {index}: {name}" for index, name in enumerate(CLASSES))]
    write_text(folder / "data.yaml", "\n".join(lines) + "\n")
