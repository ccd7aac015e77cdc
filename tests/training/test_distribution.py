"""Distribution: contradictions are named, and a process alone is not changed."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.training.distribution import (
    Devices,
    DistributionConfig,
    devices_for,
    from_first_process,
    is_first_process,
    join_processes,
    own_share,
)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (DistributionConfig(process=1), r"distribution\.process=1 is none of distribution\.processes=1"),
        (DistributionConfig("here:1", process=-1, processes=2), r"number them from 0 to 1"),
        (DistributionConfig(processes=0), r"number them from 0 to 0"),
        (DistributionConfig(processes=2), r"distribution\.coordinator is not set; give address:port of process 0"),
    ],
)
def test_contradictions_are_named(config, message):
    with pytest.raises(UserError, match=message):
        join_processes(config)


def test_a_process_alone_has_everything():
    join_processes(DistributionConfig())
    assert is_first_process()
    np.testing.assert_array_equal(own_share(np.arange(5)), np.arange(5))
    np.testing.assert_array_equal(from_first_process({"a": np.arange(3)})["a"], np.arange(3))


def test_one_device_is_given_what_it_gets():
    alone = Devices(None)
    batch = (np.arange(4), np.ones((4, 2)))
    assert alone.divide(batch) is batch and alone.own_copy(batch) is batch
    assert alone.compile(lambda x: x + 1)(jax.numpy.ones(2)).tolist() == [2.0, 2.0]
    if jax.device_count() == 1:
        assert devices_for(7) == alone
