"""From a classified clip to what the report page shows."""

from __future__ import annotations

import numpy as np

from aerojax.capture.format import Capture
from aerojax.core.types import CLASSES, SH_C0
from aerojax.pipeline.offline import Clip, FrameImages
from aerojax.reconstruct.crop import MARGIN
from aerojax.view.report.content import CameraCrop, ClassificationReport, FrameReport

SHOWN_POINTS = 1024
"""Points of a frame's cloud that the page draws; enough for a shape, few enough for a small file."""


def classification_report(
    capture: Capture, clip: Clip, so_far: np.ndarray, latency_ms: dict[str, float], truth: str | None
) -> ClassificationReport:
    """Gather frames, clouds and figures.

    Args:
        capture: where the clip comes from.
        clip: reconstructed with its images kept.
        so_far: probabilities after each frame (time, class).
        latency_ms: milliseconds a frame, per stage.
        truth: the true class where it is known.
    """
    probabilities = dict(zip(CLASSES, so_far[-1].tolist(), strict=True))
    means = np.asarray(clip.gaussians.mean, np.float32)[:, :SHOWN_POINTS]
    rgb = np.asarray(clip.gaussians.sh)[:, :SHOWN_POINTS, 0] * SH_C0 + 0.5
    colours = np.round(255 * np.clip(rgb, 0, 1)).astype(np.uint8)
    frames = tuple(
        FrameReport(images.frame, _crops(capture, images), means[i], colours[i], so_far[i], clip.position[i])
        for i, images in enumerate(clip.images)
    )
    notes = ["Clouds are the visual hull of the masks; colours come from the views that see a point."]
    if any(camera.mask is None for camera in capture.cameras):
        notes.append("The capture has no masks: the object was found by its motion.")
    return ClassificationReport(
        title=capture.folder.name,
        label=max(probabilities, key=lambda name: probabilities[name]),
        probabilities=probabilities,
        truth=truth,
        frames=frames,
        dropped=clip.dropped,
        latency_ms=latency_ms,
        notes=tuple(notes),
    )


def _crops(capture: Capture, images: FrameImages) -> tuple[CameraCrop, ...]:
    crops = []
    rgb, mask = np.asarray(images.views.rgb), np.asarray(images.views.mask)
    for index, camera in enumerate(capture.cameras):
        box = images.boxes[index]
        if images.valid[index] and box is not None:
            half = 0.5 * MARGIN * max(box[2] - box[0], box[3] - box[1])
            x, y = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
            window = (x - half, y - half, x + half, y + half)
            pixels = np.round(255 * rgb[index]).astype(np.uint8)
            crops.append(CameraCrop(camera.name, pixels, mask[index] > 0.5, window, (camera.width, camera.height)))
    return tuple(crops)
