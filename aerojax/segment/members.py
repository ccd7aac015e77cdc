"""The members behind the door of stage 1, by name."""

from aerojax.segment.auto import AutoConfig
from aerojax.segment.base import SegmenterConfig
from aerojax.segment.given import GivenConfig
from aerojax.segment.instances import InstancesConfig
from aerojax.segment.motion import MotionConfig
from aerojax.segment.voxel_vote.member import VoxelVoteConfig

MEMBERS: dict[str, type[SegmenterConfig]] = {
    "auto": AutoConfig,
    "given": GivenConfig,
    "instances": InstancesConfig,
    "motion": MotionConfig,
    "voxel_vote": VoxelVoteConfig,
}
