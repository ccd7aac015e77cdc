"""Files of an Isaac Replicator recording, by camera, annotator and frame."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float32, UInt8, UInt32

from aerojax.capture.validate.findings import Problem

_SUFFIXES = {
    "rgb": ".png",
    "camera_params": ".json",
    "instance_segmentation": ".png",
    "instance_segmentation_mapping": ".json",
    "instance_segmentation_semantics_mapping": ".json",
    "distance_to_image_plane": ".npy",
    "distance_to_camera": ".npy",
    "bounding_box_3d": ".npy",
    "bounding_box_3d_prim_paths": ".json",
}
_FILE = re.compile(rf"({'|'.join(_SUFFIXES)})_(\d+)(\.png|\.json|\.npy)")
_WITH_RGB = ("rgb_*.png", "rgb/rgb_*.png")


@dataclass(frozen=True)
class RecordedCamera:
    """One render product: its folder's name and `files[annotator][frame]`."""

    name: str
    files: dict[str, dict[int, Path]]

    def at(self, annotator: str, frame: int) -> Path | None:
        """The annotator's file of one frame."""
        return self.files.get(annotator, {}).get(frame)


def scan_recording(recording: Path) -> tuple[RecordedCamera, ...]:
    """Cameras of a recording, sorted by name: folders with colour images, nested by annotator or flat.

    A recording of a single render product (flat files in `recording` itself) is one camera.
    """
    if not recording.is_dir():
        return ()
    folders = [folder for folder in sorted(recording.iterdir()) if folder.is_dir() and _has_images(folder)]
    if any(recording.glob(_WITH_RGB[0])) or (recording / "camera_params").is_dir():
        folders = [recording]
    return tuple(RecordedCamera(folder.name, _files(folder)) for folder in folders)


def _has_images(folder: Path) -> bool:
    return any(next(folder.glob(pattern), None) is not None for pattern in _WITH_RGB)


def _files(folder: Path) -> dict[str, dict[int, Path]]:
    found: dict[str, dict[int, Path]] = {}
    for path in sorted([*folder.glob("*_*.*"), *folder.glob("*/*_*.*")]):
        match = _FILE.fullmatch(path.name)
        if match and _SUFFIXES[match[1]] == match[3]:
            found.setdefault(match[1], {})[int(match[2])] = path
    return found


class BrokenFile(Exception):
    """A file of the recording cannot be read; carries its problem."""

    def __init__(self, path: Path, message: str, remedy: str = "record it again") -> None:
        super().__init__(message)
        self.problem = Problem(str(path), "", message, remedy)


def read_json(path: Path) -> Any:
    """Content of a JSON file.

    Raises:
        BrokenFile: it is none.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise BrokenFile(path, f"is not valid JSON: {str(error)[:160]}") from None


def read_array(path: Path) -> np.ndarray:
    """Content of an .npy file; pickles are refused.

    Raises:
        BrokenFile: it is none.
    """
    try:
        return np.load(path, allow_pickle=False)
    except Exception as error:  # NumPy reads headers as Python's literals, and raises whatever its tokenizer does
        raise BrokenFile(path, f"is not a NumPy array: {str(error)[:160]}") from None


def read_colour(path: Path) -> UInt8[np.ndarray, "height width 3"]:
    """8-bit sRGB; the alpha that Replicator stores is left out.

    Raises:
        BrokenFile: the image is damaged or not 8-bit.
    """
    image = _decode(path, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION)
    if image.dtype != np.uint8:
        raise BrokenFile(path, f"has {image.dtype} values, not 8-bit ones", "record rgb, not an HDR buffer")
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def read_segments(path: Path) -> UInt32[np.ndarray, "height width"]:
    """Instance segmentation as one number a pixel: the id, or the colour as `segment_number` packs it.

    Raises:
        BrokenFile: the image is damaged.
    """
    image = _decode(path, cv2.IMREAD_UNCHANGED)
    if image.ndim == 2:
        return image.astype(np.uint32)
    if image.dtype != np.uint8 or image.shape[2] not in (3, 4):
        raise BrokenFile(path, f"has {image.shape[2]} channels of {image.dtype}, not ids or RGBA")
    blue, green, red = (image[..., i].astype(np.uint32) for i in range(3))
    alpha = image[..., 3].astype(np.uint32) if image.shape[2] == 4 else np.uint32(255)
    return red << 24 | green << 16 | blue << 8 | alpha


def segment_number(key: str) -> int | None:
    """The number that a mapping's key stands for: `"7"`, or `"(r, g, b, a)"` of a colourised image; None otherwise."""
    numbers = re.findall(r"\d+", key)
    if len(numbers) == 1 and numbers[0] == key.strip():
        return int(key)
    if len(numbers) != 4 or not all(int(n) < 256 for n in numbers):
        return None
    red, green, blue, alpha = (int(n) for n in numbers)
    return red << 24 | green << 16 | blue << 8 | alpha


def read_plane_depth(
    path: Path, *, from_centre: bool, ray_lengths: Float32[np.ndarray, "height width"]
) -> Float32[np.ndarray, "height width"]:
    """Depth along the optical axis in metres, 0 where there is none.

    Args:
        path: distance_to_image_plane, or distance_to_camera with `from_centre`.
        from_centre: whether distances run along the rays.
        ray_lengths: of each pixel's ray with z = 1.

    Raises:
        BrokenFile: no array of the image's size.
    """
    distance = np.squeeze(read_array(path))
    if distance.shape != ray_lengths.shape or distance.dtype.kind != "f":
        raise BrokenFile(path, f"is {distance.shape} of {distance.dtype}, the image is {ray_lengths.shape}")
    known = np.isfinite(distance) & (distance > 0)
    depth = np.where(known, distance, 0).astype(np.float32)
    return depth / ray_lengths if from_centre else depth


def _decode(path: Path, flags: int) -> np.ndarray:
    try:
        data = np.fromfile(path, dtype=np.uint8)
        image = cv2.imdecode(data, flags) if data.size else None
    except (cv2.error, OSError):
        image = None
    if image is None:
        raise BrokenFile(path, "the image is damaged or cut short")
    return image
