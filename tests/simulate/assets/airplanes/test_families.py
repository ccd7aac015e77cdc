"""Families of airplanes: how many each split has."""

from __future__ import annotations

from aerojax.simulate.assets.airplanes.families import airplane_families
from aerojax.simulate.assets.families import names_by_split


def test_splits_have_the_counts_of_the_data_set_and_share_no_family():
    names = names_by_split(airplane_families())
    assert {split: len(families) for split, families in names.items()} == {"train": 8, "val": 4, "test": 4}
    assert [name for families in names.values() for name in families] == list(airplane_families())
