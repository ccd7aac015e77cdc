"""Data of the page's player: crops, outlines and clouds of a bounded size, as JSON inside the page."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

from aerojax.view.encode import cloud_radius, jpegs_within, mask_box, mask_outline, pack_cloud
from aerojax.view.report.content import CameraCrop, ClassificationReport, FrameReport

IMAGE_BYTES = 2_000_000
"""Share of the images, so that the page stays below 4 MB together with the clouds and the outlines."""
CLOUD_BYTES = 900_000
OUTLINE_BYTES = 500_000
MOST_IMAGES = 1_000
"""Noise, the worst case, takes 2 kB at the smallest JPEG level, so this many fill `IMAGE_BYTES`."""
MOST_FRAMES = 600
"""More positions than a slider of a page's width can tell apart; longer captures are thinned evenly."""
MOST_POINTS = 3_000
_BYTES_PER_POINT = 12  # 3 × int16 + 3 × uint8 in base64


def shown_frames(frames: tuple[FrameReport, ...]) -> tuple[FrameReport, ...]:
    """All frames, or every second, third … where they are too many for the page."""
    images = sum(len(frame.crops) for frame in frames)
    return frames[:: max(1, math.ceil(images / MOST_IMAGES), math.ceil(len(frames) / MOST_FRAMES))]


def plot_step(frames: Sequence[FrameReport]) -> int:
    """Every which frame the curves show: all of them up to three times as many as the player."""
    return max(1, math.ceil(len(frames) / (3 * MOST_FRAMES)))


def camera_names(frames: Sequence[FrameReport]) -> list[str]:
    """Cameras that saw the object, in the order in which they appear."""
    return list(dict.fromkeys(crop.camera for frame in frames for crop in frame.crops))


def player_data(report: ClassificationReport, shown: Sequence[FrameReport]) -> dict[str, Any]:
    """What the script needs, ready for JSON; what is not finite is None."""
    radius = cloud_radius([frame.points for frame in shown])
    most = min(MOST_POINTS, CLOUD_BYTES // (_BYTES_PER_POINT * max(1, len(shown))))
    jpegs = iter(jpegs_within([crop.rgb for frame in shown for crop in frame.crops], IMAGE_BYTES))
    most_outline = max(200, min(4000, OUTLINE_BYTES // max(1, sum(len(frame.crops) for frame in shown))))
    step = plot_step(report.frames)
    index = {frame.frame: i // step for i, frame in enumerate(report.frames)}
    frames = [
        {
            "frame": frame.frame,
            "index": index[frame.frame],
            "place": [round(float(v), 3) if math.isfinite(v) else None for v in frame.position],
            "probabilities": [round(float(p), 4) if math.isfinite(p) else None for p in frame.probabilities],
            "cloud": pack_cloud(frame.points, frame.colours, radius, most),
            "crops": {crop.camera: _crop_data(crop, next(jpegs), most_outline) for crop in frame.crops},
        }
        for frame in shown
    ]
    return {"radius": radius, "classes": list(report.probabilities), "cameras": camera_names(shown), "frames": frames}


def _crop_data(crop: CameraCrop, jpeg: str, most_outline: int) -> dict[str, Any]:
    height, width = crop.mask.shape
    return {
        "jpeg": jpeg,
        "size": [width, height],
        "outline": mask_outline(crop.mask, most_outline),
        "object": mask_box(crop.mask),
        "box": [round(float(v), 1) for v in crop.box],
        "full": list(crop.full_size),
    }


def as_script(data: dict[str, Any]) -> str:
    """JSON that is safe inside a script element: no `<` can open a tag, no line separator ends a line."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
