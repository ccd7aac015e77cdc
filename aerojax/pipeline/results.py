"""A clip as it is written down: what was answered, from which frames, and what its reader should know."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerojax.capture.format import Capture
from aerojax.core.types import CLASSES
from aerojax.pipeline.offline import Clip


def result_of(capture: Capture, clip: Clip) -> dict[str, Any]:
    """The contents of `result.json`.

    Args:
        capture: what was classified.
        clip: of it, from a classifier.

    Returns:
        label and probabilities after the last frame; frames that were used, and those that were dropped with code and
        text; by camera, the frames that it was left out of, and why; what the masks hold ("ids", "picture" or None);
        warnings; positions in metres, world; median milliseconds a stage.
    """
    assert clip.log_probabilities is not None  # there was a classifier
    probabilities = dict(zip(CLASSES, np.exp(clip.log_probabilities[-1]).tolist(), strict=True))
    return {
        "capture": str(capture.folder),
        "label": max(probabilities, key=lambda name: probabilities[name]),
        "probabilities": probabilities,
        "frames": list(clip.frames),
        "dropped": {str(event.frame): {"code": event.code, "text": event.text} for event in clip.dropped},
        "missing": {camera.name: _missing(clip, index) for index, camera in enumerate(capture.cameras)},
        "masks": capture.mask_kind,
        "warnings": list(clip.warnings),
        "latency_ms": clip.latency_ms,
        "track": [{"frame": f, "position": p} for f, p in zip(clip.frames, clip.position.tolist(), strict=True)],
    }


def _missing(clip: Clip, camera: int) -> dict[str, str]:
    return {str(frame): view.text for frame, view in clip.missing if view.camera == camera}
