"""Which prims of a Replicator recording are flying objects, and of which class."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerojax.capture.imports.recording import BrokenFile, RecordedCamera, read_json, segment_number
from aerojax.capture.validate.findings import Problem, shown
from aerojax.core.types import CLASSES

_NO_OBJECT = ("BACKGROUND", "UNLABELLED")
_MAPPING, _SEMANTICS = "instance_segmentation_mapping", "instance_segmentation_semantics_mapping"


@dataclass(frozen=True)
class Segment:
    """An entry of one image's mapping: its number in the image, the prim and its label."""

    number: int
    prim: str
    label: str


def read_mapping(camera: RecordedCamera, frame: int) -> tuple[Segment, ...]:
    """Segments of one image, without the background.

    Raises:
        BrokenFile: a mapping is missing or malformed.
    """
    paths = [camera.at(kind, frame) for kind in (_MAPPING, _SEMANTICS)]
    image = camera.at("instance_segmentation", frame)
    assert image is not None, "callers ask for frames with an image"
    if paths[0] is None or paths[1] is None:
        lacking = _MAPPING if paths[0] is None else _SEMANTICS
        raise BrokenFile(image, f"has no {lacking} beside it", "copy the recording whole")
    prims, semantics = _entries(paths[0]), _entries(paths[1])
    segments = []
    for key, prim in prims.items():
        number, label = segment_number(key), _label(semantics.get(key, "UNLABELLED"))
        if number is None or not isinstance(prim, str) or label is None:
            raise BrokenFile(paths[0], f"has the entry {shown(key)}: {shown(prim)}, not an id or colour and a prim")
        if prim not in _NO_OBJECT:
            segments.append(Segment(number, prim, label))
    return tuple(segments)


def _entries(path: Path) -> dict[str, Any]:
    raw = read_json(path)
    if not isinstance(raw, dict):
        raise BrokenFile(path, f"must be an object, is {shown(raw)}")
    return raw


def _label(value: Any) -> str | None:
    """The label of an entry: `"drone"`, `{"class": "drone"}` or the first of other semantic types."""
    if isinstance(value, dict) and value:
        value = value.get("class", next(iter(value.values())))
    return value if isinstance(value, str) else None


@dataclass(frozen=True)
class FlyingPrims:
    """Prims that are objects, in order of their ids (from 1), and their classes."""

    classes: dict[str, str]

    def object_id(self, prim: str) -> int | None:
        """The id of a prim in masks and truth; None where it is scenery."""
        return next((number for number, known in enumerate(self.classes, start=1) if known == prim), None)


def find_flying_prims(
    cameras: Sequence[RecordedCamera], classes: Mapping[str, str | None], problems: list[Problem]
) -> FlyingPrims:
    """Objects of a recording, by label.

    Args:
        cameras: of the recording.
        classes: the user's word on labels and prim paths (a path wins over its label): a class, or None to ignore.
        problems: labels without a class are added, each once.
    """
    for key, value in classes.items():
        if value is not None and value not in CLASSES:
            remedy = f"use one of {', '.join(CLASSES)} or null"
            problems.append(Problem("classes", key, f"unknown class {shown(value)}", remedy))
    found: dict[str, str] = {}
    complained: set[str] = set()
    for path, segment in _all_segments(cameras, problems):
        wanted = _class_of(segment, classes)
        if isinstance(wanted, str):
            found[segment.prim] = wanted
        elif wanted is _UNKNOWN and segment.label not in complained:
            complained.add(segment.label)
            remedy = f"set classes={{{segment.label}: bird}} with its class, or null where it is scenery"
            message = f"label {shown(segment.label)} of {segment.prim} is none of {', '.join(CLASSES)}"
            problems.append(Problem(str(path), "", message, remedy))
    if not found and not problems and any("instance_segmentation" in camera.files for camera in cameras):
        remedy = "label the flying prims before recording, or name them: classes={/World/prim: drone}"
        problems.append(Problem("instance_segmentation", "", "shows no labelled flying object", remedy))
    return FlyingPrims(dict(sorted(found.items())))


_UNKNOWN = object()


def _class_of(segment: Segment, classes: Mapping[str, str | None]) -> Any:
    """A class, None to ignore, or `_UNKNOWN`. Several labels of one prim are joined by commas."""
    for key in (segment.prim, segment.label):
        if key in classes:
            return classes[key]
    for part in segment.label.split(","):
        if part.strip().lower() in CLASSES:
            return part.strip().lower()
    return None if segment.label in _NO_OBJECT else _UNKNOWN


def _all_segments(cameras: Sequence[RecordedCamera], problems: list[Problem]) -> Iterator[tuple[Path, Segment]]:
    for camera in cameras:
        for frame, path in camera.files.get("instance_segmentation", {}).items():
            try:
                for segment in read_mapping(camera, frame):
                    yield path, segment
            except BrokenFile as broken:
                problems.append(broken.problem)
