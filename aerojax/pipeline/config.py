"""Which members stand behind the doors, and the sizes between them."""

from __future__ import annotations

from dataclasses import dataclass, field

from aerojax.classify.card import Setting, flat_settings
from aerojax.core.config import require_at_least, to_mapping
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.reconstruct.base import ReconstructorConfig
from aerojax.reconstruct.hull import HullConfig
from aerojax.segment.auto import AutoConfig
from aerojax.segment.base import SegmenterConfig
from aerojax.track.base import TrackerConfig
from aerojax.track.single import SingleConfig


@dataclass(frozen=True)
class PipelineConfig:
    """From images to the classifier's Gaussians.

    segment, track, reconstruct: the members of the stages, by name.
    crop_size: side of the virtual-camera crops, pixels.
    view_size: side of the smaller crops that classifiers of views read, pixels.
    min_views: cameras that must show the object, one of them the whole of it; a frame with fewer is dropped. Two make
        a hull, but nothing tells whether they are right: `TrustConfig.least_views` calls such answers unsure.
    decimation: from the reconstructor's Gaussians to the classifier's.
    lost_after: frames without an object after which it is lost; it appears anew when it comes again.
    """

    segment: SegmenterConfig = field(default_factory=AutoConfig)
    track: TrackerConfig = field(default_factory=SingleConfig)
    reconstruct: ReconstructorConfig = field(default_factory=HullConfig)
    crop_size: int = 128
    view_size: int = 32
    min_views: int = 2
    decimation: DecimationConfig = field(default_factory=DecimationConfig)
    lost_after: int = 90

    def __post_init__(self) -> None:
        """Refuse what no frame could be used with.

        Raises:
            UserError: names the field and the least that works.
        """
        require_at_least(self, "crop_size", least=16)
        require_at_least(self, "view_size", least=8)
        require_at_least(self, "min_views", least=2)
        require_at_least(self, "lost_after")


def clip_settings(config: PipelineConfig) -> dict[str, Setting]:
    """What decides how the Gaussians and crops look that a classifier gets, by dotted key: what its card remembers."""
    chosen = {
        "crop_size": config.crop_size,
        "view_size": config.view_size,
        "reconstruct": to_mapping(config.reconstruct),
        "decimation": to_mapping(config.decimation),
    }
    return dict(flat_settings(chosen))
