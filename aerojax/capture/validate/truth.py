"""Checks of `truth.json` against the capture that it belongs to."""

from __future__ import annotations

from typing import Any

from aerojax.capture.paths import pattern_problem
from aerojax.capture.validate.findings import Findings, shown
from aerojax.capture.validate.state import (
    OPTIONAL_STATE,
    by_camera,
    check_boxes_3d,
    check_corners,
    check_flag,
    check_joints,
    check_quaternion,
    check_seen,
)
from aerojax.core.types import CLASSES, UNKNOWN

LARGEST_ID = 65_535  # masks are 16-bit images and 0 is the background


def check_truth(truth: dict[str, Any], cameras: list[str], frames: int | None, found: Findings) -> None:
    """Note what is wrong with the objects, their frames and their boxes.

    Args:
        truth: the parsed file, unchecked.
        cameras: names of the capture's cameras.
        frames: how many frames the capture has; None skips what depends on it.
        found: where problems go.
    """
    found.mapping(truth, "", ("objects",))
    seen: set[int] = set()
    for index, item in enumerate(found.items(truth["objects"], "objects") if "objects" in truth else ()):
        field = f"objects[{index}]"
        item = found.mapping(item, field, ("id", "class", "identity", "frames"), ("source", "licence", "gaussians"))
        if item is None:
            continue
        _check_names(item, field, seen, found)
        if "frames" in item:
            _check_states(found.items(item["frames"], f"{field}.frames"), f"{field}.frames", cameras, frames, found)


def _check_names(item: dict[str, Any], field: str, seen: set[int], found: Findings) -> None:
    number = found.whole(item["id"], f"{field}.id", 1, LARGEST_ID) if "id" in item else None
    if number in seen:
        found.add(f"{field}.id", f"{number} stands twice", "give every object an id of its own")
    if number is not None:
        seen.add(number)
    known = (*CLASSES, UNKNOWN)
    if "class" in item and item["class"] not in known:
        found.add(f"{field}.class", f"unknown class {shown(item['class'])}", f"use one of {', '.join(known)}")
    for key in ("identity", "source", "licence"):
        if key in item and not (item[key] is None and key != "identity"):
            found.text(item[key], f"{field}.{key}")
    pattern = item.get("gaussians")
    if pattern is None or found.text(pattern, f"{field}.gaussians") is None:
        return
    if problem := pattern_problem(pattern, (".ply",)):
        found.add(f"{field}.gaussians", problem, "correct the pattern")


def _check_states(states: list[Any], field: str, cameras: list[str], frames: int | None, found: Findings) -> None:
    seen: set[int] = set()
    for index, state in enumerate(states):
        where = f"{field}[{index}]"
        required = ("frame", "position", "orientation_wxyz", "bbox", "visible")
        state = found.mapping(state, where, required, OPTIONAL_STATE)
        if state is None:
            continue
        if "frame" in state:
            last = (frames or 2**31) - 1
            number = found.whole(state["frame"], f"{where}.frame", 0, last)
            if number in seen:
                found.add(f"{where}.frame", f"{number} stands twice", "keep one state a frame")
            if number is not None:
                seen.add(number)
        _check_placement(state, where, found)
        _check_boxes(state, where, cameras, found)
        check_seen(state, where, cameras, found)
        check_joints(state.get("joints", {}), f"{where}.joints", found)
        check_boxes_3d(state, where, found)
    missing = [frame for frame in range(frames or 0) if frame not in seen]
    if missing and len(states) < (frames or 0):
        first = ", ".join(map(str, missing[:5])) + (" …" if len(missing) > 5 else "")
        message = f"{len(missing)} of {frames} frames are missing: {first}"
        found.add(field, message, "write a state for every frame; `visible` says where the object is out of sight")


def _check_placement(state: dict[str, Any], where: str, found: Findings) -> None:
    if "position" in state:
        found.numbers(state["position"], f"{where}.position", 3)
    if "orientation_wxyz" in state:
        check_quaternion(state["orientation_wxyz"], f"{where}.orientation_wxyz", found)


def _check_boxes(state: dict[str, Any], where: str, cameras: list[str], found: Findings) -> None:
    boxes, visible = state.get("bbox", {}), state.get("visible", {})
    good = [
        by_camera(value, f"{where}.{key}", cameras, found) for key, value in (("bbox", boxes), ("visible", visible))
    ]
    if not all(good):
        return
    check_corners(boxes, f"{where}.bbox", found)
    for camera, flag in visible.items():
        if (
            check_flag(flag, f"{where}.visible.{shown(camera)[1:-1]}", found)
            and "bbox" in state
            and (camera in cameras and camera not in boxes)
        ):
            found.add(f"{where}.bbox", f"visible in {shown(camera)} but without a box there", "add the box")
