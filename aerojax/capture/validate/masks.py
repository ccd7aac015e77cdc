"""What the masks of a capture hold: instance ids, or pictures of one object. A few of them are decoded to see."""

from __future__ import annotations

import heapq
from pathlib import Path
from typing import Any

from aerojax.capture.codecs.mask import BrokenMask, Levels, MaskKind, decode_mask, is_soft, mask_kind
from aerojax.capture.paths import frame_paths
from aerojax.capture.validate.findings import Clock, Findings

LOOKED_AT = 2
"""Masks of each camera that are decoded: the largest files, which show most."""


def check_masks(folder: Path, cameras: list[dict[str, Any]], clock: Clock, found: Findings) -> MaskKind | None:
    """What the masks of cameras without a `mask_kind` hold, by what all of them look like; shades are noted.

    Args:
        folder: the capture's folder.
        cameras: entries of `capture.json` in which there is nothing wrong.
        clock: of the capture.
        found: where problems and warnings go.
    """
    undeclared = [i for i, camera in enumerate(cameras) if camera.get("mask") and "mask_kind" not in camera]
    levels = [one for i in undeclared for one in _examples(folder, i, cameras[i], clock, found)]
    judged = [(mask_kind(one), is_soft(one)) for one in levels]
    kinds = {kind for kind, _ in judged if kind is not None}
    soft = ("picture", True) in judged
    # One image of 0 and 255 may be instance 255 of a capture with others; shades are shades whatever the others are.
    if soft:
        found.warn(
            f"cameras[{undeclared[0]}].mask",
            "shades between 0 and full are taken as the share of each pixel that one object covers",
            'if they are instance ids, write "mask_kind": "ids" in each camera',
        )
    return "picture" if soft or kinds == {"picture"} else "ids" if kinds else None


def _examples(folder: Path, index: int, camera: dict[str, Any], clock: Clock, found: Findings) -> list[Levels]:
    """Levels of the camera's largest masks; colours that mean nothing are a problem."""
    pattern, levels = camera.get("mask"), []
    if pattern is None or clock.frames is None:
        return levels
    files = frame_paths(pattern, range(clock.frames))
    for size, relative in heapq.nlargest(LOOKED_AT, ((_size(folder / one), one) for one in files)):
        try:
            levels += [decode_mask((folder / relative).read_bytes())] if size else []
        except OSError:
            continue  # found to be missing or unreadable where the files are checked
        except BrokenMask as broken:
            if broken.damaged:
                continue  # left out, and named, in its frame
            found.add(f"cameras[{index}].mask", broken.problem, broken.remedy, file=relative)
            break
    return levels


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
