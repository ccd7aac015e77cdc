"""What cannot be built is refused by name; both members are behind the door."""

from __future__ import annotations

import dataclasses

import pytest

from aerojax.core.config import to_dataclass, to_mapping
from aerojax.core.errors import UserError
from aerojax.reconstruct.base import TrainableConfig
from aerojax.reconstruct.depthsplat.config import DepthSplatConfig, DepthSplatTinyConfig, parity_config
from aerojax.reconstruct.members import MEMBERS


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"size": 100}, "size is 100"),
        ({"candidates": 1}, "candidates is 1"),
        ({"sh_degree": 4}, "sh_degree is 4"),
        ({"blocks": 3}, "blocks is 3"),
        ({"vit_blocks": 6}, "vit_blocks is 6"),
        ({"windows": 3}, "windows is 3"),
        ({"vit_width": 100}, "vit_width is 100"),
        ({"unet_width": 48}, "unet_width is 48"),
        ({"near": 3.0}, "near is 3.0"),
        ({"scale_min": 1.0}, "scale_max is 0.01"),
        ({"capacity": 0}, "capacity is 0"),
    ],
)
def test_refusals(changes, named):
    with pytest.raises(UserError, match=named) as caught:
        DepthSplatConfig(**changes)
    assert caught.value.code == "out-of-range"


@pytest.mark.parametrize("config", [DepthSplatConfig(), DepthSplatTinyConfig(), parity_config()])
def test_members(config):
    assert isinstance(config, TrainableConfig) and type(config) is MEMBERS[config.name]
    assert to_dataclass(to_mapping(config), type(config)) == config
    fields = {field.name for field in dataclasses.fields(config)}
    assert set(config.adjustable) <= fields
