"""The stages' members where nothing else is said: live cameras bring no masks, and see several objects."""

from __future__ import annotations

from dataclasses import dataclass, field

from aerojax.pipeline.config import PipelineConfig
from aerojax.segment.base import SegmenterConfig
from aerojax.segment.voxel_vote.member import VoxelVoteConfig
from aerojax.track.base import TrackerConfig
from aerojax.track.several import SeveralConfig


@dataclass(frozen=True)
class LivePipelineConfig(PipelineConfig):
    """The pipeline's settings, with other members by default.

    segment: finds the objects of each frame, by their motion in several cameras; `instances` takes masks that come with
        the images. track: follows them; `several`, or `single` where there is never more than one.
    """

    segment: SegmenterConfig = field(default_factory=VoxelVoteConfig)
    track: TrackerConfig = field(default_factory=SeveralConfig)
