"""Splits that share names, families, files or shapes are found; disjoint ones pass."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.dataset_entries import sequence

from aerojax.core.errors import UserError
from aerojax.data.manifest import DatasetEntries, IdentityEntry
from aerojax.evaluate.dataset_qa.leakage import Embedded, leakage, verdict


def crossing(tmp_path: Path, test_shape: float, test_bytes: bytes, family: str = "c") -> DatasetEntries:
    cast = [("bird_a", "a", "train", b"1"), ("bird_b", "b", "train", b"2"), ("bird_c", family, "test", test_bytes)]
    identities = []
    for name, kind, split, content in cast:
        (tmp_path / f"{name}.usdc").write_bytes(content)
        identities.append(IdentityEntry(name, "bird", kind, split, tmp_path / f"{name}.usdc", "CC-BY-4.0", "aerojax"))
    return DatasetEntries((tmp_path,), (sequence("c", "bird", "test", 5),), tuple(identities))


def embedded(entries: DatasetEntries, *places: float) -> list[Embedded]:
    return [Embedded(i, np.array([p, 0.0]), 0.01) for i, p in zip(entries.identities, places, strict=True)]


def test_disjoint_splits_pass(tmp_path):
    entries = crossing(tmp_path, 3.0, b"3")
    found = leakage(entries, embedded(entries, 0.0, 1.0, 3.0))
    assert all(verdict(found).values())
    assert found.by_class[0].train_to_train == (1.0, 1.0)
    assert found.by_class[0].test_to_train == (2.0, 2.0)
    assert found.near == ()


def test_copies_are_found_by_bytes_and_by_shape(tmp_path):
    entries = crossing(tmp_path, 0.0, b"1", family="a")
    found = leakage(entries, embedded(entries, 0.0, 1.0, 0.02))
    passed = verdict(found)
    assert not passed["files are disjoint"] and found.shared_files == (("bird_a", "bird_c"),)
    assert not passed["families are disjoint"] and found.shared_families == ("bird a",)
    assert not passed["no held-out shape is a copy"] and found.copies[0].nearest == "bird_a"
    assert passed["names are disjoint"]


def test_near_shapes_and_out_of_split(tmp_path):
    entries = crossing(tmp_path, 0.4, b"3")
    stranger = sequence("c", "bird", "test", 5, "bird_a")
    entries = DatasetEntries(entries.folders, (stranger,), entries.identities)
    found = leakage(entries, embedded(entries, 0.0, 1.0, 0.4))
    assert [n.identity for n in found.near] == ["bird_c"] and found.copies == ()
    assert found.out_of_split == ("c",) and not verdict(found)["sequences keep to their split"]


def test_a_missing_asset_is_named(tmp_path):
    entries = crossing(tmp_path, 0.0, b"3")
    (tmp_path / "bird_b.usdc").unlink()
    with pytest.raises(UserError, match=r"bird_b\.usdc"):
        leakage(entries, embedded(entries, 0.0, 1.0, 2.0))
