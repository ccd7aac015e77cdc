"""Families of multicopters: how many each split has."""

from __future__ import annotations

from aerojax.simulate.assets.families import names_by_split
from aerojax.simulate.assets.multicopters.families import multicopter_families


def test_splits_have_the_counts_of_the_data_set_and_share_no_family():
    names = names_by_split(multicopter_families())
    assert {split: len(families) for split, families in names.items()} == {"train": 15, "val": 7, "test": 8}
    assert [name for families in names.values() for name in families] == list(multicopter_families())
