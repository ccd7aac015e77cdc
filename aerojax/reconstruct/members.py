"""The members behind the door of stage 2, by name."""

from aerojax.reconstruct.base import ReconstructorConfig
from aerojax.reconstruct.constant import ConstantConfig
from aerojax.reconstruct.hull import HullConfig
from aerojax.reconstruct.lgm.config import LgmConfig

MEMBERS: dict[str, type[ReconstructorConfig]] = {"hull": HullConfig, "constant": ConstantConfig, "lgm": LgmConfig}
