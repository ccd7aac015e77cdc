"""What the report of one classified capture says, before it is a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float, Float64, UInt8

from aerojax.view.viewer.content import Lens, SceneCamera, Splats

Number = int | float
Status = Literal["ok", "unsure", "insufficient"]
"""Whether the label may be believed; see `aerojax.pipeline.trust`."""


@dataclass(frozen=True, eq=False)
class CameraCrop:
    """What one camera saw of the object.

    camera: its name.
    rgb: sRGB pixels of the crop.
    mask: the object in the crop.
    box: x0 y0 x1 y1 of the crop in full-image pixels, ends exclusive; may be scaled to `rgb`.
    full_size: width and height of the full image in pixels.
    lens: that of the crop's own pinhole camera. centre_from_cam: rigid transform, metres, from this camera's axes to
        world axes about the object's centre (`FrameReport.centre`).
    """

    camera: str
    rgb: UInt8[np.ndarray, "height width 3"]
    mask: Bool[np.ndarray, "height width"]
    box: tuple[Number, Number, Number, Number]
    full_size: tuple[int, int]
    lens: Lens
    centre_from_cam: Float64[np.ndarray, "4 4"]


@dataclass(frozen=True, eq=False)
class FrameReport:
    """One frame that was used.

    frame: index in the capture.
    crops: one a camera that saw the object.
    splats: the reconstructed Gaussians about `centre`.
    centre: metres, world frame.
    probabilities: of the classes after this frame, in the order of the report's.
    position: the object's place, metres, world frame; NaN where unknown.
    """

    frame: int
    crops: tuple[CameraCrop, ...]
    splats: Splats
    centre: Float64[np.ndarray, "3"]
    probabilities: Float[np.ndarray, "category"]
    position: Float[np.ndarray, "3"]


@dataclass(frozen=True)
class CameraAgreement:
    """How well one camera agrees with the others, medians over the frames; None where nothing is known.

    camera: its name.
    shift_px, shift_m: of its outlines. ray_px, ray_m: of its central ray. uncovered: share of its silhouette, 0..1.
    suspect: whether it is the one that is wrong.
    """

    camera: str
    shift_px: float | None
    shift_m: float | None
    ray_px: float | None
    ray_m: float | None
    uncovered: float | None
    suspect: bool


@dataclass(frozen=True, eq=False)
class ClassificationReport:
    """All that the page shows.

    title: name of the capture. label: the likeliest class or "unknown", the answer where `status` is ok.
    truth: the right answer where it is known.
    probabilities: final ones, 0..1, by class name.
    frames: the frames used, ascending. dropped: reason by frame number.
    latency_ms: wall time by stage, milliseconds, in the pipeline's order.
    fps: frames a second.
    rig: the cameras.
    notes: sentences to show at the end. made_by: version and weights, by name.
    status: whether the label may be believed; if not, or if it is "unknown", `reasons` say why.
    warnings: sentences that the reader should know first.
    agreement: of the cameras.
    explanation: what the answer stands on, see `evaluate.saliency.explanation`; None if it was not asked for.
    """

    title: str
    label: str
    probabilities: Mapping[str, float]
    truth: str | None
    frames: tuple[FrameReport, ...]
    dropped: Mapping[int, str]
    latency_ms: Mapping[str, float]
    fps: float = 30.0
    rig: tuple[SceneCamera, ...] = ()
    notes: tuple[str, ...] = ()
    made_by: Mapping[str, str] = field(default_factory=dict)
    status: Status = "ok"
    reasons: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    agreement: tuple[CameraAgreement, ...] = ()
    explanation: Mapping[str, Any] | None = None
