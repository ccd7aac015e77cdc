"""Sizes of the parts, row by row, and operations as the thesis counts them."""

from __future__ import annotations

import pytest

from aerojax.reconstruct.depthsplat.config import DepthSplatConfig, DepthSplatTinyConfig, parity_config
from aerojax.reconstruct.depthsplat.cost import operations, part_sizes, published_operations

TABLE = {
    "backbone": 1_049_120,
    "transformer": 3_150_336,
    "monocular": 22_056_192,
    "regressor": 6_379_776,
    "straight": 90_240,
    "depth_head": 442_688,
    "depth_upsampler": 2_107_649,
    "feature_upsampler": 2_707_888,
    "gaussian_regressor": 76_736,
    "gaussian_head": 56_351,
}


def test_parameters_of_the_thesis():
    sizes = part_sizes(parity_config())
    assert sizes == TABLE and sum(sizes.values()) == 38_116_976


@pytest.mark.parametrize(
    ("changes", "total"), [({"candidates": 128}, 38.346e6), ({"unet_width": 64}, 33.20e6), ({"sh_degree": 0}, 38.08e6)]
)
def test_parameters_of_others(changes, total):
    """Upstream's default of 128 candidates, the thesis' halved width if it were used, colours of degree 0."""
    assert sum(part_sizes(DepthSplatConfig(**changes)).values()) == pytest.approx(total, rel=1e-4)


def test_tiny_is_tiny():
    assert 500_000 < sum(part_sizes(DepthSplatTinyConfig()).values()) <= 1_500_000


def test_operations_of_the_thesis():
    assert published_operations(parity_config(), 5) == pytest.approx(969.02e9, rel=1e-5)
    assert published_operations(parity_config(), 4) == pytest.approx(716.67e9 + 0.137e9, rel=5e-5)


def test_what_the_published_count_leaves_out():
    """The attention of the monocular branch: two products of 325² scores, 64 channels and 6 heads in 12 blocks."""
    config = parity_config()
    attention = 5 * 12 * 6 * 2 * 2 * 325 * 325 * 64
    adapter, geometry = 5 * 256 * 256 * 524, 2 * 9 * 20 * 4096 * 66
    assert operations(config, 5) == published_operations(config, 5) + attention - adapter - geometry
