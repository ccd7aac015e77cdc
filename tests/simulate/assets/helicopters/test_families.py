"""Families of helicopters: how many each split has."""

from __future__ import annotations

from aerojax.simulate.assets.families import names_by_split
from aerojax.simulate.assets.helicopters.families import helicopter_families


def test_splits_have_the_counts_of_the_data_set_and_share_no_family():
    names = names_by_split(helicopter_families())
    assert {split: len(families) for split, families in names.items()} == {"train": 8, "val": 4, "test": 4}
    assert [name for families in names.values() for name in families] == list(helicopter_families())
