"""Checks of one object's state in one frame: what the cameras see of it, and its joints."""

from __future__ import annotations

import math
from typing import Any

from aerojax.capture.validate.findings import Findings, is_finite_number, shown

_SEEN = ("truncated", "visibility", "visible_box", "projected_box", "surface_centroid", "projected_corners")
OPTIONAL_STATE = (*_SEEN, "joints", "oriented_box", "aligned_box")


def by_camera(value: Any, field: str, cameras: list[str], found: Findings) -> bool:
    """Whether `value` is an object; keys that name no camera are noted."""
    if not isinstance(value, dict):
        found.add(field, f"must be an object, is {shown(value)}", "write { camera: … }")
        return False
    for camera in sorted(set(value) - set(cameras)):
        found.add(field, f"unknown camera {shown(camera)}", f"cameras are {', '.join(cameras)}")
    return True


def check_flag(value: Any, field: str, found: Findings) -> bool:
    """Whether the value is `true`; anything but true and false is noted."""
    if not isinstance(value, bool):
        found.add(field, f"must be true or false, is {shown(value)}", "correct the value")
        return False
    return value


def check_corners(boxes: dict[str, Any], field: str, found: Findings) -> None:
    """Boxes of four finite numbers whose ends lie behind their beginnings."""
    for camera, box in boxes.items():
        corner_field = f"{field}.{shown(camera)[1:-1]}"
        corners = found.numbers(box, corner_field, 4)
        if corners is not None and (corners[0] >= corners[2] or corners[1] >= corners[3]):
            found.add(corner_field, f"{shown(corners)} is empty", "write x0, y0, x1, y1 with exclusive ends")


def check_quaternion(value: Any, field: str, found: Findings) -> None:
    """Four finite numbers of unit length."""
    quaternion = found.numbers(value, field, 4)
    if quaternion is not None and abs(math.hypot(*quaternion) - 1) > 1e-3:
        found.add(field, f"{shown(quaternion)} is not of unit length", "normalise it")


def check_seen(state: dict[str, Any], where: str, cameras: list[str], found: Findings) -> None:
    """The optional fields by camera: `truncated`, `visibility`, both boxes, `surface_centroid` and corners."""
    values = {key: state[key] for key in _SEEN if key in state}
    values = {key: value for key, value in values.items() if by_camera(value, f"{where}.{key}", cameras, found)}
    for camera, flag in values.get("truncated", {}).items():
        check_flag(flag, f"{where}.truncated.{shown(camera)[1:-1]}", found)
    for camera, share in values.get("visibility", {}).items():
        if not is_finite_number(share) or not 0 <= share <= 1:
            field = f"{where}.visibility.{shown(camera)[1:-1]}"
            found.add(field, f"must be a number from 0 to 1, is {shown(share)}", "write visible over all pixels")
    for name in ("visible_box", "projected_box"):
        check_corners(values.get(name, {}), f"{where}.{name}", found)
    for camera, point in values.get("surface_centroid", {}).items():
        found.numbers(point, f"{where}.surface_centroid.{shown(camera)[1:-1]}", 3)
    for camera, corners in values.get("projected_corners", {}).items():
        field = f"{where}.projected_corners.{shown(camera)[1:-1]}"
        corners = found.items(corners, field)
        if len(corners) != 8:
            found.add(field, f"has {len(corners)} corners", "write the 8 corners of the box as [u, v]")
        for number, corner in enumerate(corners):
            found.numbers(corner, f"{field}[{number}]", 2)


def check_boxes_3d(state: dict[str, Any], where: str, found: Findings) -> None:
    """Both boxes in space: of finite numbers, none of them turned inside out."""
    for name, first, second in (("oriented_box", "centre", "size"), ("aligned_box", "low", "high")):
        if state.get(name) is None:
            continue
        field = f"{where}.{name}"
        box = found.mapping(state[name], field, (first, second))
        keys = [key for key in (first, second) if box is not None and key in box]
        ends = {key: found.numbers(box[key], f"{field}.{key}", 3) for key in keys} if box is not None else {}
        low, high = ends.get(first), ends.get(second)
        if low is None or high is None:
            continue
        least = [0.0] * 3 if name == "oriented_box" else low
        if any(end < start for start, end in zip(least, high, strict=True)):
            found.add(field, f"{second} {shown(high)} is too small", "correct the box")


def check_joints(joints: Any, field: str, found: Findings) -> None:
    """Joints by name, each with a position and a unit quaternion."""
    if not isinstance(joints, dict):
        found.add(field, f"must be an object, is {shown(joints)}", "write { joint: … }")
        return
    for name, joint in joints.items():
        where = f"{field}.{shown(name)[1:-1]}"
        joint = found.mapping(joint, where, ("position", "orientation_wxyz"))
        if joint is not None and "position" in joint:
            found.numbers(joint["position"], f"{where}.position", 3)
        if joint is not None and "orientation_wxyz" in joint:
            check_quaternion(joint["orientation_wxyz"], f"{where}.orientation_wxyz", found)
