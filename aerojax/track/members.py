"""The members behind the tracker's door, by name."""

from aerojax.track.base import TrackerConfig
from aerojax.track.several import SeveralConfig
from aerojax.track.single import SingleConfig

MEMBERS: dict[str, type[TrackerConfig]] = {"several": SeveralConfig, "single": SingleConfig}
