"""The members behind the door of stage 2, by name."""

from aerojax.reconstruct.base import ReconstructorConfig
from aerojax.reconstruct.constant import ConstantConfig
from aerojax.reconstruct.depthsplat.config import DepthSplatConfig, DepthSplatTinyConfig
from aerojax.reconstruct.hull import HullConfig
from aerojax.reconstruct.lgm.config import LgmConfig
from aerojax.reconstruct.refine.config import RefineConfig

MEMBERS: dict[str, type[ReconstructorConfig]] = {
    "hull": HullConfig,
    "constant": ConstantConfig,
    "depthsplat": DepthSplatConfig,
    "depthsplat_tiny": DepthSplatTinyConfig,
    "lgm": LgmConfig,
    "refine": RefineConfig,
}
