"""Families of birds: how many each split has, and that every kind of bill and tail is drawn."""

from __future__ import annotations

from aerojax.simulate.assets.birds.bodies import BILLS, TAILS
from aerojax.simulate.assets.birds.families import bird_families
from aerojax.simulate.assets.families import names_by_split


def test_splits_have_the_counts_of_the_data_set_and_share_no_family():
    names = names_by_split(bird_families())
    assert {split: len(families) for split, families in names.items()} == {"train": 15, "val": 6, "test": 8}
    assert [name for families in names.values() for name in families] == list(bird_families())


def test_every_bill_and_tail_belongs_to_a_bird():
    for field, known in (("bill", BILLS), ("tail", TAILS)):
        used = [family.ranges[field] for family in bird_families().values()]
        assert {v for one in used for v in (one if isinstance(one, list) else [one])} == set(known)
