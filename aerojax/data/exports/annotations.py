"""What the truth says about each object in each image: what the formats annotate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, UInt16

from aerojax.capture.format import Capture
from aerojax.capture.truth import ObjectState, TrackedObject
from aerojax.core.errors import UserError
from aerojax.core.types import Box


@dataclass(frozen=True, eq=False)
class Annotation:
    """One object in one image.

    item, state: the object and its state in this frame.
    camera: name of the image's camera.
    box: x0 y0 x1 y1 in pixels of the undistorted image, ends exclusive, clipped to the image.
    visibility: share of the object's own pixels that nothing hides, or None where the truth does not say.
    truncated: whether the object reaches beyond the image, or None.
    whole_box: box of the whole object, what is hidden or beyond the image included, or None.
    """

    item: TrackedObject
    state: ObjectState
    camera: str
    box: Box
    visibility: float | None
    truncated: bool | None
    whole_box: Box | None


def image_annotations(capture: Capture, camera_index: int, frame: int) -> Iterator[Annotation]:
    """Objects that the truth says are visible in an image, in the truth's order.

    Raises:
        UserError: the capture has no truth.
    """
    if capture.truth is None:
        raise UserError(
            "missing", f"{capture.folder}: has no truth.json, so there is nothing to annotate", "add it to the capture"
        )
    camera = capture.cameras[camera_index]
    for item in capture.truth.objects:
        state = item.frames[frame]
        if not state.visible.get(camera.name, False):
            continue
        x0, y0, x1, y1 = state.bbox[camera.name]
        box = max(x0, 0.0), max(y0, 0.0), min(x1, float(camera.width)), min(y1, float(camera.height))
        if box[0] < box[2] and box[1] < box[3]:
            visibility, truncated = state.visibility.get(camera.name), state.truncated.get(camera.name)
            whole = state.projected_box.get(camera.name)
            yield Annotation(item, state, camera.name, box, visibility, truncated, whole)


def object_pixels(
    mask: UInt16[np.ndarray, "height width"] | None, annotation: Annotation
) -> Bool[np.ndarray, "height width"] | None:
    """The pixels of one object, or None where there is no mask or it has none."""
    if mask is None:
        return None
    pixels = mask == annotation.item.object_id
    return pixels if pixels.any() else None
