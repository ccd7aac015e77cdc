"""Waits double up to the longest."""

from __future__ import annotations

import pytest

from aerojax.core.errors import UserError
from aerojax.serve.retries import RetryConfig


def test_waits_double():
    retry = RetryConfig(first_s=0.5, most_s=5.0)
    assert [retry.delay_s(failures) for failures in (1, 2, 3, 4, 5, 10_000)] == [0.5, 1.0, 2.0, 4.0, 5.0, 5.0]


def test_the_longest_is_no_less_than_the_first():
    with pytest.raises(UserError, match=r"most_s is 0\.1"):
        RetryConfig(first_s=0.5, most_s=0.1)
