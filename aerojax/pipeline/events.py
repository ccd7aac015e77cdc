"""What the pipeline says after each frame. Frames are numbers of the network's clock, tracks numbers of the tracker."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64

from aerojax.core.types import Box, Evidence, Gaussians, Observation
from aerojax.reconstruct.consistency import Consistency

DropCode = Literal["too-few-views", "silhouettes-disjoint"]
"""Why an object of a frame could not be used:

too-few-views: fewer cameras than needed show it whole, also with those that show a part which fits.
silhouettes-disjoint: the silhouettes meet nowhere: calibration, masks or clocks are wrong.
"""


@dataclass(frozen=True)
class Appeared:
    """An object that was not there before."""

    frame: int
    track: int


@dataclass(frozen=True, eq=False)
class Updated:
    """An object that was seen and reconstructed.

    position: of its centre, metres, world frame.
    observation: what was cut out; None where images are not kept.
    seen: the decimated Gaussians, metres, rig frame (`observation.world_from_rig` takes them to the world), and the
        crops that classifiers of views read.
    log_probabilities: of the classes, from all frames so far; None where frames cannot be classified one by one.
    consistency: how well the cameras agree in this frame.
    shift_m: by which a camera's picture was displaced to fit the others, at most, metres at the object; 0 where the
        silhouettes fit as they are.
    cut: cameras whose image's border cuts the object, of which the part in the image is used.
    familiarity: share of known objects that look as strange to the classifier; see `classify.familiarity`. None where
        it is not known.
    """

    frame: int
    track: int
    position: Float64[np.ndarray, "3"]
    seen: Evidence
    observation: Observation | None
    log_probabilities: Float32[np.ndarray, "label"] | None
    consistency: Consistency
    shift_m: float = 0.0
    cut: tuple[int, ...] = ()
    familiarity: float | None = None

    @property
    def gaussians(self) -> Gaussians:
        """Those of what was seen."""
        return self.seen.gaussians


@dataclass(frozen=True, eq=False)
class OneCamera:
    """What one camera alone shows of a whole object, as long as no frame has shown it to several: no place.

    camera: its index in the network. box: of the object in that camera's image, pixels.
    seen: the crops that classifiers of views read, and no Gaussians.
    log_probabilities: of the classes, from all such frames so far; None where frames cannot be classified one by one.
    """

    camera: int
    box: Box
    seen: Evidence
    log_probabilities: Float32[np.ndarray, "label"] | None


@dataclass(frozen=True)
class Dropped:
    """A frame that could not be used, of one object or of all where `track` is None.

    consistency: how well the cameras agree; None where too few of them show the object.
    one_camera: what can be said without a place where one camera shows the object; None elsewhere, where the object was
        seen by several before, and for classifiers that read Gaussians alone.
    """

    frame: int
    track: int | None
    code: DropCode
    text: str
    consistency: Consistency | None = None
    one_camera: OneCamera | None = None


@dataclass(frozen=True)
class Lost:
    """An object that was not seen for so long that it counts as gone."""

    frame: int
    track: int


Event = Appeared | Updated | Dropped | Lost
