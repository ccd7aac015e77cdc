"""The scene as the viewer's script gets it: rig, track, ground and first view, relative to an origin of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float64

from aerojax.view.templates import read_template
from aerojax.view.viewer.content import SceneCamera

SCRIPTS = ("linear", "program", "splats", "lines", "drawing", "orbit", "viewer")
"""Files of the viewer in an order in which each uses only those before it."""
FIRST_PITCH_DEG, YAW_FROM_CAMERA_DEG = 18.0, 30.0
"""The first view: a little from above, beside the first camera, so that depth is seen."""
FIELD_OF_VIEW_DEG = 32.0
"""As in `orbit.js`."""


@cache
def viewer_script() -> str:
    """All that a page needs to make a `Viewer`."""
    return "\n".join(read_template(f"viewer/{name}.js") for name in SCRIPTS)


def scene_data(
    rig: Sequence[SceneCamera],
    track: Sequence[Float64[np.ndarray, "3"] | None],
    centres: Float64[np.ndarray, "step 3"],
    radius: float,
) -> dict[str, Any]:
    """What does not change over time, ready for JSON.

    Args:
        rig: cameras, world frame.
        track: the object's place at each step, metres, world; None where it is unknown.
        centres: what the Gaussians of each reconstructed step stand about, metres, world; at least one.
        radius: of the object, metres.
    """
    origin = scene_origin(centres)
    places = np.stack([*(camera.world_from_cam[:3, 3] for camera in rig), *centres]) - origin
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    lowest = float(places[:, 2].min() + origin[2])
    return {
        "radius": round(radius, 4),
        "rig": [_camera(camera, origin) for camera in rig],
        "track": [None if place is None else rounded(place - origin) for place in track],
        "ground": round(min(lowest, 0.0) - float(origin[2]), 4)
        if lowest < 1e4
        else round(float(places[:, 2].min()), 4),
        "middle": rounded(middle),
        "extent": round(max(float(np.linalg.norm(places - middle, axis=1).max()), 2 * radius), 3),
        "yaw": round(first_yaw(rig, centres[0]), 2),
        "pitch": FIRST_PITCH_DEG,
    }


def scene_origin(centres: Float64[np.ndarray, "step 3"]) -> Float64[np.ndarray, "3"]:
    """The point, metres, world, that everything is told from: 32-bit floats lose digits far from zero."""
    return np.round(centres.mean(axis=0), 3)


def first_yaw(rig: Sequence[SceneCamera], place: Float64[np.ndarray, "3"]) -> float:
    """Degrees about +z from +x at which the viewer stands first."""
    towards = rig[0].world_from_cam[:3, 3] - place if rig else np.array([1.0, 0.0, 0.0])
    return math.degrees(math.atan2(towards[1], towards[0])) + YAW_FROM_CAMERA_DEG


def rounded(values: Float64[np.ndarray, "..."], digits: int = 4) -> list[float]:
    """A flat list for JSON; four digits are a tenth of a millimetre."""
    return [round(float(value), digits) for value in values.ravel()]


def _camera(camera: SceneCamera, origin: Float64[np.ndarray, "3"]) -> dict[str, Any]:
    return {
        "name": camera.name,
        "centre": rounded(camera.world_from_cam[:3, 3] - origin),
        "axes": rounded(camera.world_from_cam[:3, :3], 6),
        "lens": [round(value, 3) for value in camera.lens],
        "suspect": camera.suspect,
    }
