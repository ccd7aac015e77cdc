"""Data of the page's player: crops, outlines and Gaussians of a bounded size, as JSON inside the page."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerojax.view.encode import jpegs_within, mask_box, mask_outline
from aerojax.view.report.content import CameraCrop, ClassificationReport, FrameReport
from aerojax.view.viewer.pack import BYTES_PER_SPLAT, pack_splats, reach
from aerojax.view.viewer.scene import rounded, scene_data, scene_origin

IMAGE_BYTES = 1_500_000
"""Share of the images, so that the page stays below 4 MB together with the Gaussians and the outlines."""
SPLAT_BYTES = 1_500_000
OUTLINE_BYTES = 400_000
MOST_IMAGES = 750
"""Noise, the worst case, takes 2 kB at the smallest JPEG level, so this many fill `IMAGE_BYTES`."""
MOST_STEPS = 600
"""More positions than a slider of a page's width can tell apart; longer captures are thinned evenly."""
MOST_SPLATS = 4096


@dataclass(frozen=True, eq=False)
class Step:
    """One position of the slider: a frame that was used, or the reason why it was not."""

    frame: int
    used: FrameReport | None
    reason: str | None = None


def steps_of(report: ClassificationReport) -> tuple[Step, ...]:
    """Every frame that was used or dropped, ascending."""
    steps = [Step(frame.frame, frame) for frame in report.frames]
    steps += [Step(frame, None, reason) for frame, reason in report.dropped.items()]
    return tuple(sorted(steps, key=lambda step: step.frame))


def shown_steps(steps: Sequence[Step]) -> tuple[Step, ...]:
    """All steps, or every second, third … where they are too many for the page."""
    images = sum(len(step.used.crops) for step in steps if step.used)
    return tuple(steps[:: max(1, math.ceil(images / MOST_IMAGES), math.ceil(len(steps) / MOST_STEPS))])


def plot_step(frames: Sequence[FrameReport]) -> int:
    """Every which frame the curves show: all of them up to three times as many as the player."""
    return max(1, math.ceil(len(frames) / (3 * MOST_STEPS)))


def camera_names(report: ClassificationReport) -> list[str]:
    """Cameras of the rig, then those that only crops name, in the order in which they appear."""
    seen = (crop.camera for frame in report.frames for crop in frame.crops)
    return list(dict.fromkeys([*(camera.name for camera in report.rig), *seen]))


def player_data(report: ClassificationReport, shown: Sequence[Step]) -> dict[str, Any]:
    """What the script needs, ready for JSON; what is not finite is None."""
    used = [step.used for step in shown if step.used]
    head = {"classes": list(report.probabilities), "cameras": camera_names(report), "fps": report.fps}
    if not used:
        return {**head, "scene": None, "steps": []}
    radius = reach([frame.splats for frame in used])
    centres = np.stack([frame.centre for frame in used])
    track = [None if step.used is None else _known(step.used.position) for step in shown]
    jpegs = iter(jpegs_within([crop.rgb for frame in used for crop in frame.crops], IMAGE_BYTES))
    most = min(MOST_SPLATS, SPLAT_BYTES // (BYTES_PER_SPLAT * len(used)))
    most_outline = max(200, min(4000, OUTLINE_BYTES // max(1, sum(len(frame.crops) for frame in used))))
    origin, places, steps = scene_origin(centres), _cursor_places(report), []
    for step in shown:
        data: dict[str, Any] = {"frame": step.frame, "index": places[step.frame], "dropped": step.reason}
        if (frame := step.used) is not None:
            data |= {
                "place": [round(float(v), 3) if math.isfinite(v) else None for v in frame.position],
                "centre": rounded(frame.centre - origin),
                "probabilities": [round(float(p), 4) if math.isfinite(p) else None for p in frame.probabilities],
                "splats": pack_splats(frame.splats, most),
                "count": len(frame.splats.mean),
                "crops": {crop.camera: crop_data(crop, next(jpegs), most_outline) for crop in frame.crops},
            }
        steps.append(data)
    return {**head, "scene": scene_data(report.rig, track, centres, radius), "steps": steps}


def _known(position: np.ndarray) -> np.ndarray | None:
    return position.astype(np.float64) if np.isfinite(position).all() else None


def _cursor_places(report: ClassificationReport) -> dict[int, int]:
    """By frame, the point of the curves at which their cursors stand: the frame's own or the last used before it."""
    every, places, last = plot_step(report.frames), {}, 0
    index = {frame.frame: i // every for i, frame in enumerate(report.frames)}
    for frame in sorted({*index, *report.dropped}):
        last = index.get(frame, last)
        places[frame] = last
    return places


def crop_data(crop: CameraCrop, jpeg: str, most_outline: int) -> dict[str, Any]:
    """One picture with its overlays."""
    height, width = crop.mask.shape
    cam_from_centre = np.linalg.inv(crop.centre_from_cam)
    return {
        "jpeg": jpeg,
        "size": [width, height],
        "outline": mask_outline(crop.mask, most_outline),
        "object": mask_box(crop.mask),
        "box": [round(float(v), 1) for v in crop.box],
        "full": list(crop.full_size),
        "lens": [round(value, 3) for value in crop.lens],
        "pose": rounded(cam_from_centre[:3], 6),
    }


def as_script(data: dict[str, Any]) -> str:
    """JSON that is safe inside a script element: no `<` can open a tag, no line separator ends a line."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
