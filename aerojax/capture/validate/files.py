"""Checks of the image and video files of one camera, from their headers alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from aerojax.capture.codecs.headers import BrokenImage, ImageHeader, read_header
from aerojax.capture.codecs.mask import MaskKind
from aerojax.capture.paths import (
    FLOAT_SUFFIXES,
    MASK_SUFFIXES,
    PNG_SUFFIXES,
    RGB_SUFFIXES,
    frame_paths,
    is_inside,
    is_video,
    pattern_problem,
)
from aerojax.capture.validate.findings import Clock, Findings, shown, size_problem
from aerojax.capture.validate.videos import check_video

_KINDS: dict[str, tuple[tuple[str, ...], Callable[[ImageHeader], str | None]]] = {
    "rgb": (RGB_SUFFIXES, lambda h: None if h.bits in (8, 16) else f"has {h.bits} bits a channel, not 8 or 16"),
    "mask": (
        MASK_SUFFIXES,
        lambda h: None if h.bits in (1, 2, 4, 8, 16) and not h.floating else "is not an image of 1 to 16 bits",
    ),
    "depth": (FLOAT_SUFFIXES, lambda h: None if h.floating and h.bits == 32 and h.channels == 1 else "is not float32"),
    "coverage": (PNG_SUFFIXES, lambda h: None if (h.channels, h.bits) == (1, 8) else "is not a grey 8-bit image"),
    "normal": (PNG_SUFFIXES, lambda h: None if (h.channels, h.bits) == (3, 16) else "is not a 16-bit RGB image"),
    "flow": (
        FLOAT_SUFFIXES,
        lambda h: None if h.floating and (h.channels, h.bits) == (2, 32) else "is not float32 with two channels",
    ),
}


@dataclass(frozen=True)
class _Complaint:
    """What is wrong with a file; `lost`: it is missing or damaged, so that its frame can do without it."""

    message: str
    lost: bool = False


def check_frame_files(folder: Path, camera: dict[str, Any], field: str, clock: Clock, found: Findings) -> None:
    """Note what is wrong with the patterns of a camera and with the files that they name.

    Args:
        folder: the capture's folder.
        camera: the camera's entry in `capture.json`, unchecked.
        field: its JSON path.
        clock: the capture's.
        found: where problems go; files with the same complaint share one entry.
    """
    if "mask_kind" in camera and camera["mask_kind"] not in get_args(MaskKind):
        words = " or ".join(map(repr, get_args(MaskKind)))
        found.add(f"{field}.mask_kind", f"must be {words}, is {shown(camera['mask_kind'])}", "correct the word")
    for kind, (suffixes, complaint) in _KINDS.items():
        pattern = camera.get(kind)
        if pattern is None:
            if kind == "rgb" and kind in camera:
                found.add(f"{field}.rgb", "must be a file pattern, is None", "write the pattern")
            continue
        if not isinstance(pattern, str):
            found.add(f"{field}.{kind}", f"must be a file pattern, is {shown(pattern)}", "write text in quotes")
        elif problem := pattern_problem(pattern, suffixes, video=kind == "rgb", outside=clock.outside):
            found.add(f"{field}.{kind}", f"{shown(pattern)} {problem}", "use a path such as cam/rgb/{frame:06d}.png")
        elif is_video(pattern) and kind == "rgb":
            check_video(folder, camera, pattern, clock, f"{field}.rgb", found)
        elif clock.frames is not None:
            _check_images(folder, camera, kind, clock, complaint, f"{field}.{kind}", found)


def _check_images(
    folder: Path,
    camera: dict[str, Any],
    kind: str,
    clock: Clock,
    complaint: Callable[[ImageHeader], str | None],
    field: str,
    found: Findings,
) -> None:
    complaints: dict[_Complaint, list[str]] = {}
    listings: dict[str, frozenset[str] | None] = {}
    total = clock.frames or 0
    for relative in frame_paths(camera[kind], range(total)):
        message = _image_problem(folder, relative, camera, complaint, listings, outside=clock.outside)
        if message:
            complaints.setdefault(message, []).append(relative)
    effect = "the camera is left out of these frames" if kind in ("rgb", "mask") else f"there is no {kind} in them"
    lost = sum(len(files) for one, files in complaints.items() if one.lost)
    for one, files in complaints.items():
        more = f" (and {len(files) - 1} more of {total})" if len(files) > 1 else ""
        if one.lost and not clock.refuse and lost < total:
            found.warn(field, one.message + more, effect, file=files[0])
        else:
            found.add(field, one.message + more, "write the file again or correct capture.json", file=files[0])


def _image_problem(
    folder: Path,
    relative: str,
    camera: dict[str, Any],
    complaint: Callable[[ImageHeader], str | None],
    listings: dict[str, frozenset[str] | None],
    *,
    outside: bool,
) -> _Complaint | None:
    parent, slash, name = relative.rpartition("/")
    if parent not in listings:  # one look at the disk a folder: following links and asking file by file is slow
        listings[parent] = _listing(folder, folder / (parent or slash), outside=outside)
    names = listings[parent]
    if names is None:
        return _Complaint("links out of the capture's folder")
    if name not in names:
        return _Complaint("the file is missing", lost=True)
    path = folder / relative
    if path.is_symlink() and not is_inside(folder, path, outside=outside):
        return _Complaint("links out of the capture's folder")
    if not path.is_file():
        return _Complaint("the file is missing", lost=True)
    try:
        header = read_header(path)
    except BrokenImage as error:
        return _Complaint(str(error), lost=True)
    wrong = complaint(header) or size_problem(header.width, header.height, camera)
    return _Complaint(wrong) if wrong else None


def _listing(folder: Path, parent: Path, *, outside: bool) -> frozenset[str] | None:
    """Names in a folder of the capture, empty where there is no such folder; None where it lies outside."""
    if not is_inside(folder, parent, outside=outside):
        return None
    return frozenset(entry.name for entry in parent.iterdir()) if parent.is_dir() else frozenset()
