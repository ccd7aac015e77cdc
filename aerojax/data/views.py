"""Scenes of views on disk: what cameras record of an object, and what it truly looks like from elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Bool, Float16, Float32, UInt8

from aerojax.core.errors import UserError
from aerojax.core.files import whole_file

RECORD = "views.json"
"""What a folder of scenes says of how they were made."""


@dataclass(frozen=True, eq=False)
class ViewSet:
    """Scenes: one object in one pose before one network of cameras each. Cameras have world_from_cam in metres in the
    crop's frame, whose origin is at the object; images are square.

    rgb, mask, valid, K, world_from_cam: crops as the pipeline cuts them: sRGB and coverage as bytes, whether the view
        counts, the stated cameras.
    width_px: longer side of the object's box in the cameras' own images, median.
    target_rgb: the object alone over black from other places, sRGB times coverage, bytes; over a background of any
        colour it is target_rgb + (1 - target_mask)·colour.
    target_mask: coverage, bytes.
    target_relief: depth along the optical axis less the camera's distance from the origin, metres; 0 without coverage.
    target_K, target_world_from_cam: their true cameras.
    name: of object and pose. kind: class of the object, or "solid". rig: layout of the cameras.
    """

    rgb: UInt8[np.ndarray, "scene view size size 3"]
    mask: UInt8[np.ndarray, "scene view size size"]
    valid: Bool[np.ndarray, "scene view"]
    K: Float32[np.ndarray, "scene view 3 3"]
    world_from_cam: Float32[np.ndarray, "scene view 4 4"]
    width_px: Float32[np.ndarray, "scene"]
    target_rgb: UInt8[np.ndarray, "scene target size size 3"]
    target_mask: UInt8[np.ndarray, "scene target size size"]
    target_relief: Float16[np.ndarray, "scene target size size"]
    target_K: Float32[np.ndarray, "scene target 3 3"]
    target_world_from_cam: Float32[np.ndarray, "scene target 4 4"]
    name: tuple[str, ...]
    kind: tuple[str, ...]
    rig: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.rgb)

    @property
    def size(self) -> int:
        """Side of the images, pixels."""
        return self.rgb.shape[-2]


TEXTS = ("name", "kind", "rig")
ARRAYS = tuple(field.name for field in fields(ViewSet) if field.name not in TEXTS)


def stacked(scenes: Sequence[Mapping[str, np.ndarray | str]]) -> ViewSet:
    """Single scenes, by the names of `ViewSet`'s fields, put together."""
    values: dict[str, Any] = {name: np.stack([np.asarray(scene[name]) for scene in scenes]) for name in ARRAYS}
    values |= {name: tuple(str(scene[name]) for scene in scenes) for name in TEXTS}
    return ViewSet(**values)


def save_views(path: Path, views: ViewSet) -> None:
    """Write a shard, whole or not at all."""
    with whole_file(path) as temporary, temporary.open("wb") as file:
        values: dict[str, Any] = {name: np.asarray(getattr(views, name)) for name in (*ARRAYS, *TEXTS)}
        np.savez_compressed(file, **values)


def load_views(folders: Iterable[Path], *, most: int | None = None) -> ViewSet:
    """Every scene of the shards in folders, in the order of their names.

    Args:
        folders: each holds `*.npz` of `save_views`.
        most: leave out what comes after so many scenes.

    Raises:
        UserError: a folder holds no shard, a shard is damaged, or their sizes differ.
    """
    parts, count = [], 0
    for folder in folders:
        paths = sorted(folder.glob("*.npz"))
        if not paths:
            raise UserError("missing", f"{folder} holds no views", "make them: python -m experiments.generate_views")
        for path in paths:
            if most is None or count < most:
                parts.append(_read(path))
                count += len(parts[-1])
    shapes = {(part.size, part.target_rgb.shape[1]) for part in parts}
    if len(shapes) != 1:
        raise UserError("mismatch", f"views of several sizes or numbers of targets: {sorted(shapes)}", "use one folder")
    joined: dict[str, Any] = {n: np.concatenate([getattr(part, n) for part in parts])[:most] for n in ARRAYS}
    joined |= {name: tuple(value for part in parts for value in getattr(part, name))[:most] for name in TEXTS}
    return ViewSet(**joined)


def _read(path: Path) -> ViewSet:
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            values: dict[str, Any] = {name: file[name] for name in ARRAYS}
            values |= {name: tuple(map(str, file[name])) for name in TEXTS}
            return ViewSet(**values)
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise UserError("unreadable", f"{path} is no complete shard of views ({error})", "delete it") from None
