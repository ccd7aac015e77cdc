"""MOTChallenge: one sequence a camera, `aerojax-<split>/<sequence>__<camera>/{img1,gt/gt.txt,seqinfo.ini}`.

A line of gt.txt is frame (from 1), id, left, top, width, height, 1, 1, visibility; left and top are 0 at the image's
border, as in all exports. The class column is 1 throughout, because the benchmark's evaluation scores class 1
(pedestrian) alone: evaluate without its pedestrian preprocessing. `gt/objects.json` says which class each id has.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from aerojax.capture.format import Capture
from aerojax.core.errors import UserError
from aerojax.core.files import write_json, write_text
from aerojax.data.exports.annotations import image_annotations
from aerojax.data.exports.images import place_image, recorded_frames
from aerojax.data.exports.sources import ExportOptions, SourceSequence, camera_names

BENCHMARK = "aerojax"
_UNIFORM = (".png",)
"""seqinfo.ini names one ending for all images of a sequence."""


def write_sequence(
    capture: Capture, sequence: SourceSequence, folder: Path, options: ExportOptions
) -> dict[str, list[str]]:
    """Write one sequence a camera; the part lists their names."""
    names = []
    for camera_index, camera_name in enumerate(camera_names(capture)):
        name = f"{sequence.name}__{camera_name}"
        frames = recorded_frames(capture, camera_index)
        if not frames:
            continue
        target = folder / f"{BENCHMARK}-{sequence.split}" / name
        text = ""
        for number, frame in enumerate(frames, start=1):
            image = target / "img1" / f"{number:06d}"
            place_image(capture, camera_index, frame, image, options.images, suffixes=_UNIFORM)
            text += _box_lines(capture, camera_index, frame, number)
        _write_truth(target, capture, text)
        write_text(target / "seqinfo.ini", _sequence_info(capture, camera_index, name, len(frames)))
        names.append(name)
    return {"sequences": names}


def _box_lines(capture: Capture, camera_index: int, frame: int, number: int) -> str:
    text = ""
    for seen in image_annotations(capture, camera_index, frame):
        x0, y0, x1, y1 = seen.box
        visibility = 1.0 if seen.visibility is None else seen.visibility
        corner = f"{x0:.3f},{y0:.3f},{x1 - x0:.3f},{y1 - y0:.3f}"
        text += f"{number},{seen.item.object_id},{corner},1,1,{visibility:.4f}\n"
    return text


def _write_truth(target: Path, capture: Capture, text: str) -> None:
    if capture.truth is None:
        raise UserError(
            "missing", f"{capture.folder}: has no truth.json, so there is nothing to track", "add it to the capture"
        )
    write_text(target / "gt" / "gt.txt", text)
    objects = {o.object_id: {"class": o.class_name, "identity": o.identity} for o in capture.truth.objects}
    write_json(target / "gt" / "objects.json", objects)


def _sequence_info(capture: Capture, camera_index: int, name: str, length: int) -> str:
    camera = capture.cameras[camera_index]
    return (
        f"[Sequence]\nname={name}\nimDir=img1\nframeRate={capture.fps:g}\nseqLength={length}\n"
        f"imWidth={camera.width}\nimHeight={camera.height}\nimExt=.png\n"
    )


def finish(folder: Path, parts: Sequence[Path]) -> None:
    """Write the list of sequences of each split to `seqmaps/`."""
    names: dict[str, list[str]] = {}
    for part in parts:
        names.setdefault(part.parent.name, []).extend(json.loads(part.read_text())["sequences"])
    for split, listed in names.items():
        write_text(folder / "seqmaps" / f"{BENCHMARK}-{split}.txt", "\n".join(["name", *listed]) + "\n")
