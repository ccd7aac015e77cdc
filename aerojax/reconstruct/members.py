"""The members behind the door of stage 2, by name."""

from aerojax.reconstruct.base import ReconstructorConfig
from aerojax.reconstruct.constant import ConstantConfig
from aerojax.reconstruct.hull import HullConfig
from aerojax.reconstruct.lgm.config import LgmConfig
from aerojax.reconstruct.refine.config import RefineConfig

MEMBERS: dict[str, type[ReconstructorConfig]] = {
    "hull": HullConfig,
    "constant": ConstantConfig,
    "lgm": LgmConfig,
    "refine": RefineConfig,
}
