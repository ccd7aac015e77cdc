"""From a classified capture to what the report page shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.core.types import CLASSES, SH_C0, Gaussians, Observation
from aerojax.view.report.content import CameraAgreement, CameraCrop, ClassificationReport, FrameReport

SHOWN_POINTS = 1024
"""Points of a frame's cloud that the page draws; enough for a shape, few enough for a small file."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What a classifier said of one object of a capture.

    observations: what was seen in each frame that was used.
    gaussians: of these frames, world, metres, leading axis time.
    position: their centres, metres, world.
    so_far: probabilities after each frame.
    dropped: sentences by the number of each frame that could not be used.
    latency_ms: milliseconds a frame, per stage.
    truth: the true class where it is known.
    sure: whether the likeliest class is the answer. reasons: sentences why not.
    agreement: of the cameras by name, see `pipeline.results.agreement_of`.
    """

    observations: Sequence[Observation]
    gaussians: Gaussians
    position: Float[np.ndarray, "time 3"]
    so_far: Float[np.ndarray, "time label"]
    dropped: Mapping[int, str]
    latency_ms: dict[str, float]
    truth: str | None
    sure: bool = True
    reasons: Sequence[str] = ()
    agreement: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


def classification_report(capture: Capture, answer: Answer) -> ClassificationReport:
    """Gather frames, clouds and figures of the page."""
    probabilities = dict(zip(CLASSES, answer.so_far[-1].tolist(), strict=True))
    means = np.asarray(answer.gaussians.mean, np.float32)[:, :SHOWN_POINTS]
    rgb = np.asarray(answer.gaussians.sh)[:, :SHOWN_POINTS, 0] * SH_C0 + 0.5
    colours = np.round(255 * np.clip(rgb, 0, 1)).astype(np.uint8)
    frames = tuple(
        FrameReport(
            seen.frame, _crops(capture.cameras, seen), means[i], colours[i], answer.so_far[i], answer.position[i]
        )
        for i, seen in enumerate(answer.observations)
    )
    notes = ["Clouds are the visual hull of the masks; colours come from the views that see a point."]
    if any(camera.mask is None for camera in capture.cameras):
        notes.append("The capture has no masks: the object was found by its motion.")
    return ClassificationReport(
        title=capture.folder.name,
        label=max(probabilities, key=lambda name: probabilities[name]),
        probabilities=probabilities,
        truth=answer.truth,
        frames=frames,
        dropped=dict(answer.dropped),
        latency_ms=answer.latency_ms,
        notes=tuple(notes),
        sure=answer.sure,
        reasons=tuple(answer.reasons),
        agreement=tuple(_agreement(name, figures) for name, figures in answer.agreement.items()),
    )


def _agreement(name: str, figures: Mapping[str, Any]) -> CameraAgreement:
    names = ("shift_px", "shift_m", "ray_px", "ray_m", "uncovered")
    return CameraAgreement(name, *(figures[one] for one in names), suspect=figures["suspect"] is not None)


def _crops(cameras: Sequence[CaptureCamera], seen: Observation) -> tuple[CameraCrop, ...]:
    rgb, mask = np.asarray(seen.views.rgb), np.asarray(seen.views.mask)
    crops = []
    for index, camera in enumerate(cameras):
        if seen.valid[index]:
            corners = seen.windows[index]
            x0, y0, x1, y1 = *corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()
            pixels = np.round(255 * rgb[index]).astype(np.uint8)
            size = camera.width, camera.height
            crops.append(CameraCrop(camera.name, pixels, mask[index] > 0.5, (x0, y0, x1, y1), size))
    return tuple(crops)
