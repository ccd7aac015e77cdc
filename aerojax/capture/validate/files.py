"""Checks of the image and video files of one camera, from their headers alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from aerojax.capture.codecs.headers import BrokenImage, ImageHeader, read_header
from aerojax.capture.codecs.video import BrokenVideo, open_video
from aerojax.capture.paths import (
    FLOAT_SUFFIXES,
    MASK_SUFFIXES,
    RGB_SUFFIXES,
    frame_paths,
    is_inside,
    is_video,
    pattern_problem,
)
from aerojax.capture.validate.findings import Findings, shown

_KINDS: dict[str, tuple[tuple[str, ...], Callable[[ImageHeader], str | None]]] = {
    "rgb": (RGB_SUFFIXES, lambda h: None if h.bits in (8, 16) else f"has {h.bits} bits a channel, not 8 or 16"),
    "mask": (
        MASK_SUFFIXES,
        lambda h: None if h.channels == 1 and h.bits in (8, 16) else "is not a grey 8/16-bit image",
    ),
    "depth": (FLOAT_SUFFIXES, lambda h: None if h.floating and h.bits == 32 and h.channels == 1 else "is not float32"),
    "coverage": (MASK_SUFFIXES, lambda h: None if (h.channels, h.bits) == (1, 8) else "is not a grey 8-bit image"),
    "normal": (MASK_SUFFIXES, lambda h: None if (h.channels, h.bits) == (3, 16) else "is not a 16-bit RGB image"),
    "flow": (
        FLOAT_SUFFIXES,
        lambda h: None if h.floating and (h.channels, h.bits) == (2, 32) else "is not float32 with two channels",
    ),
}


def check_frame_files(folder: Path, camera: dict[str, Any], field: str, frames: int | None, found: Findings) -> None:
    """Note what is wrong with the patterns of a camera and with the files that they name.

    Args:
        folder: the capture's folder.
        camera: the camera's entry in `capture.json`, unchecked.
        field: its JSON path.
        frames: how many frames the capture has; None (itself a problem) skips the files.
        found: where problems go; files with the same complaint share one entry.
    """
    for kind, (suffixes, complaint) in _KINDS.items():
        pattern = camera.get(kind)
        if pattern is None:
            if kind == "rgb" and kind in camera:
                found.add(f"{field}.rgb", "must be a file pattern, is None", "write the pattern")
            continue
        if not isinstance(pattern, str):
            found.add(f"{field}.{kind}", f"must be a file pattern, is {shown(pattern)}", "write text in quotes")
        elif problem := pattern_problem(pattern, suffixes, video=kind == "rgb"):
            found.add(f"{field}.{kind}", f"{shown(pattern)} {problem}", "use a path such as cam/rgb/{frame:06d}.png")
        elif is_video(pattern) and kind == "rgb":
            _check_video(folder, camera, pattern, frames, f"{field}.rgb", found)
        elif frames is not None:
            _check_images(folder, camera, pattern, range(frames), complaint, f"{field}.{kind}", found)


def _check_images(
    folder: Path,
    camera: dict[str, Any],
    pattern: str,
    frames: range,
    complaint: Callable[[ImageHeader], str | None],
    field: str,
    found: Findings,
) -> None:
    complaints: dict[str, list[str]] = {}
    listings: dict[str, frozenset[str] | None] = {}
    for relative in frame_paths(pattern, frames):
        message = _image_problem(folder, relative, camera, complaint, listings)
        if message:
            complaints.setdefault(message, []).append(relative)
    for message, files in complaints.items():
        more = f" (and {len(files) - 1} more of {len(frames)})" if len(files) > 1 else ""
        found.add(field, message + more, "write the file again or correct capture.json", file=files[0])


def _image_problem(
    folder: Path,
    relative: str,
    camera: dict[str, Any],
    complaint: Callable[[ImageHeader], str | None],
    listings: dict[str, frozenset[str] | None],
) -> str | None:
    parent, _, name = relative.rpartition("/")
    if parent not in listings:  # one look at the disk a folder: following links and asking file by file is slow
        listings[parent] = _listing(folder, folder / parent)
    names = listings[parent]
    if names is None:
        return "links out of the capture's folder"
    if name not in names:
        return "the file is missing"
    path = folder / relative
    if path.is_symlink() and not is_inside(folder, path):
        return "links out of the capture's folder"
    if not path.is_file():
        return "the file is missing"
    try:
        header = read_header(path)
    except BrokenImage as error:
        return str(error)
    return complaint(header) or _size_problem(header.width, header.height, camera)


def _listing(folder: Path, parent: Path) -> frozenset[str] | None:
    """Names in a folder of the capture, empty where there is no such folder; None where it lies outside."""
    if not is_inside(folder, parent):
        return None
    return frozenset(entry.name for entry in parent.iterdir()) if parent.is_dir() else frozenset()


def _size_problem(width: int, height: int, camera: dict[str, Any]) -> str | None:
    wanted = camera.get("width"), camera.get("height")
    if all(isinstance(side, int) for side in wanted) and wanted != (width, height):
        return f"is {width}×{height} pixels, the camera {wanted[0]}×{wanted[1]}"
    return None


def _check_video(
    folder: Path, camera: dict[str, Any], name: str, frames: int | None, field: str, found: Findings
) -> None:
    path = folder / name
    if not is_inside(folder, path):
        found.add(field, "links out of the capture's folder", "put the file into the folder", file=name)
        return
    if not path.is_file():
        found.add(field, "the file is missing", "put the video there or correct capture.json", file=name)
        return
    try:
        video = open_video(path)
    except OSError as error:
        found.add(field, f"cannot be read: {error.strerror}", "check the permissions", file=name)
        return
    except BrokenVideo as broken:
        found.add(field, broken.problem, broken.remedy, file=name)
        return
    if problem := _size_problem(video.width, video.height, camera):
        found.add(field, problem, "correct the size in capture.json; is the video turned by its metadata?", file=name)
    count = video.frame_count()
    if frames is not None and count < frames:
        found.add(field, f"has {count} frames, the capture {frames}", "lower `frames` in capture.json", file=name)
