"""Images and videos of each camera: found by the camera's name, numbered, and put where a capture has them."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from aerojax.capture.codecs.headers import BrokenImage, read_header
from aerojax.capture.codecs.video import BrokenVideo, open_video
from aerojax.capture.imports.calibration.base import CalibratedCamera
from aerojax.capture.paths import MASK_SUFFIXES, RGB_SUFFIXES, VIDEO_SUFFIXES, safe_name
from aerojax.core.errors import UserError

Place = Literal["auto", "beside", "hardlink", "copy", "link", "absolute"]
"""How images come into the capture:

auto: beside where the capture's folder holds them already, else hardlink. beside: not at all, they are there.
hardlink: under a second name, or as a copy where the file system has no such links. copy: as copies.
link: by symbolic links. absolute: by absolute paths. The last two need the images to stay where they are, and the
capture says that its files lie outside of its folder.
"""
_NUMBERED = re.compile(r"(.*?)(\d+)(\D*)")
_WITHIN = ("", "images", "videos", "rgb")
"""Folders in which a camera's images or video are looked for, below the given one."""
_SPARSE = 10
"""Numbers that span more than so many times their count are time stamps, not numbers of frames."""


@dataclass(frozen=True)
class Media:
    """One camera's files.

    video: its video, or None. images: its images by number of the frame as the names have it.
    width, height: pixels. fps: of the video, 0 where it has none. count: pictures.
    """

    video: Path | None
    images: dict[int, Path]
    width: int
    height: int
    fps: float = 0.0

    @property
    def count(self) -> int:
        """Pictures of the video; frames from the first to the last image."""
        if self.video is not None:
            return open_video(self.video).frame_count()
        return max(self.images) - min(self.images) + 1


def find_media(camera: CalibratedCamera, folder: Path) -> Media:
    """The video or images of a camera below a folder.

    Looked for are `<name>.mp4` (or another video) and a folder `<name>` with images or one video, in `folder` and its
    `images` and `videos`; then the files that the calibration names.

    Raises:
        UserError: there is nothing, or more than one video, or a file is damaged.
    """
    for place in (folder / inner for inner in _WITHIN):
        for suffix in VIDEO_SUFFIXES:
            if (place / f"{camera.name}{suffix}").is_file():
                return _video(place / f"{camera.name}{suffix}")
        if (place / camera.name).is_dir():
            found = _in_folder(place / camera.name)
            if found is not None:
                return found
    named = [path for file in camera.files if (path := _named(folder, file)) is not None]
    if named:
        return _images(named)
    raise UserError(
        "missing",
        f"{folder}: no images and no video of camera {camera.name}",
        f"put them into {folder / camera.name}/ or name the video {camera.name}.mp4",
    )


def find_cameras(folder: Path) -> dict[str, Media]:
    """The videos and folders of images in a folder, by the names of the cameras that they are called by, sorted."""
    place = next((folder / inner for inner in ("videos", "images") if (folder / inner).is_dir()), folder)
    found = {path.stem: _video(path) for path in _files(place, VIDEO_SUFFIXES)}
    for inner in sorted(path for path in place.iterdir() if path.is_dir()) if place.is_dir() else ():
        media = _in_folder(inner)
        if media is not None:
            found[inner.name] = media
    return dict(sorted(found.items()))


def find_masks(camera: CalibratedCamera, folder: Path | None, rgb: Media) -> dict[int, Path]:
    """Masks by number of the frame: of the folder given, or those that lie in `mask` beside the camera's `rgb`."""
    if folder is None:
        first = next(iter(rgb.images.values()), None)
        beside = first.parent.parent / "mask" if first is not None and first.parent.name == "rgb" else None
        return _numbered(_files(beside, MASK_SUFFIXES)) if beside is not None and beside.is_dir() else {}
    for place in (folder / inner for inner in ("", "masks")):
        for own in (place / camera.name, place / camera.name / "mask"):
            if own.is_dir() and (files := _files(own, MASK_SUFFIXES)):
                return _numbered(files)
    return _numbered([path for file in camera.masks if (path := _named(folder, file)) is not None])


def _named(folder: Path, file: str) -> Path | None:
    """A file that a calibration names, below the folder; what would leave it is not looked for."""
    path = Path(file)
    if path.is_absolute() or ".." in path.parts:
        return None
    options = (folder / path, folder / "images" / path, folder / Path(*path.parts[1:]))
    return next((option for option in options if option.is_file()), None)


def _in_folder(folder: Path) -> Media | None:
    for place in (folder, folder / "rgb"):
        images = _files(place, RGB_SUFFIXES)
        if images:
            return _images(images)
        videos = _files(place, VIDEO_SUFFIXES)
        if len(videos) > 1:
            raise UserError("invalid", f"{place}: holds {len(videos)} videos", "leave one a camera")
        if videos:
            return _video(videos[0])
    return None


def _files(folder: Path, suffixes: Sequence[str]) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in suffixes and path.is_file())


def _numbered(files: Sequence[Path]) -> dict[int, Path]:
    """Files by the last number in their names; by their order where those are no numbers of frames."""
    matches = [_NUMBERED.fullmatch(path.name) for path in files]
    numbers = [int(match[2]) for match in matches if match is not None]
    counted = len(files) == len(numbers) == len(set(numbers))
    if counted and numbers and max(numbers) - min(numbers) < _SPARSE * len(numbers):
        return dict(sorted(zip(numbers, files, strict=True)))
    return dict(enumerate(files))


def _images(files: Sequence[Path]) -> Media:
    images = _numbered(files)
    first = next(iter(images.values()))
    try:
        header = read_header(first)
    except BrokenImage as broken:
        raise UserError("unreadable", f"{first}: {broken}", "write or copy it again") from None
    return Media(None, images, header.width, header.height)


def _video(path: Path) -> Media:
    try:
        video = open_video(path)
    except BrokenVideo as broken:
        raise UserError("unreadable", f"{path}: {broken.problem}", broken.remedy) from None
    return Media(path, {}, video.width, video.height, video.fps)


@dataclass(frozen=True)
class Placing:
    """Where the capture's files go.

    out: the folder that `capture.json` will lie in. target: where files are written now, `out` or a stand-in for it.
    first: the number of the frame that becomes 0.
    """

    out: Path
    target: Path
    first: int
    place: Place

    def video(self, name: str, path: Path) -> str:
        """The path of a camera's video in `capture.json`."""
        if self.place in ("beside", "absolute"):
            return self._there(path)
        relative = f"{safe_name(name)}/video{path.suffix.lower()}"
        _bring(path, self.target / relative, self.place)
        return relative

    def images(self, name: str, kind: str, images: dict[int, Path]) -> str:
        """The pattern of a camera's images in `capture.json`."""
        if self.place in ("beside", "absolute"):
            pattern = self._pattern(images)
            if pattern is None:
                raise UserError(
                    "invalid",
                    f"{next(iter(images.values())).parent}: the images are not numbered from 0 in one way",
                    "set place=hardlink or place=link, which number them",
                )
            return pattern
        suffix = next(iter(images.values())).suffix.lower()
        for number, path in images.items():
            if path.suffix.lower() != suffix:
                raise UserError(
                    "invalid", f"{path}: is not {suffix}, as the others", "convert the images to one format"
                )
            relative = f"{safe_name(name)}/{kind}/{number - self.first:06d}{suffix}"
            _bring(path, self.target / relative, self.place)
        return f"{safe_name(name)}/{kind}/{{frame:06d}}{suffix}"

    def _there(self, path: Path) -> str:
        if self.place == "absolute":
            return str(path.resolve())
        if not lies_below([path], self.out):
            raise UserError("invalid", f"{path}: lies outside of out={self.out}", "set out to the images' folder")
        return path.resolve().relative_to(self.out.resolve()).as_posix()

    def _pattern(self, images: dict[int, Path]) -> str | None:
        """A pattern that gives all the images by their numbers, if there is one that begins with 0."""
        paths = list(images.values())
        match = _NUMBERED.fullmatch(paths[0].name)
        if match is None or self.first != 0:
            return None
        head, digits, tail = match.groups()
        for form in (f"0{len(digits)}d", "d"):
            if all(path.name == f"{head}{number:{form}}{tail}" for number, path in images.items()):
                folder = self._there(paths[0].parent)
                name = f"{head}{{frame{':' + form if form != 'd' else ''}}}{tail}"
                return name if folder == "." else f"{folder}/{name}"
        return None


def lies_below(media: Sequence[Path], folder: Path) -> bool:
    """Whether all files lie below a folder, links followed."""
    return all(path.resolve().is_relative_to(folder.resolve()) for path in media)


def _bring(source: Path, path: Path, place: Place) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        if place == "link":
            path.symlink_to(source.resolve())
        elif place == "copy":
            shutil.copyfile(source, path)
        else:
            try:
                os.link(source.resolve(), path)
            except OSError:  # another file system, or one without such links
                shutil.copyfile(source, path)
    except OSError as error:
        raise UserError("unreadable", f"{path}: cannot be made from {source}: {error.strerror}", "check both") from None
