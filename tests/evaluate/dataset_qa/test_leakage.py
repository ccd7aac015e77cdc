"""Splits that share names, families, files or shapes are found; disjoint ones pass."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.dataset_entries import sequence

from aerojax.core.errors import UserError
from aerojax.data.manifest import DatasetEntries, IdentityEntry
from aerojax.evaluate.dataset_qa.leakage import Embedded, leakage, verdict
from aerojax.evaluate.dataset_qa.shape_jobs import samplings_of
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import identities


def crossing(tmp_path: Path, test_shape: float, test_bytes: bytes, family: str = "c") -> DatasetEntries:
    cast = [("bird_a", "a", "train", b"1"), ("bird_b", "b", "train", b"2"), ("bird_c", family, "test", test_bytes)]
    identities = []
    for name, kind, split, content in cast:
        (tmp_path / f"{name}.usdc").write_bytes(content)
        identities.append(IdentityEntry(name, "bird", kind, split, tmp_path / f"{name}.usdc", "CC-BY-4.0", "aerojax"))
    return DatasetEntries((tmp_path,), (sequence("c", "bird", "test", 5),), tuple(identities))


def embedded(entries: DatasetEntries, *places: float) -> list[Embedded]:
    """Five samplings a hundredth apart about each place."""
    spread = 0.01 * np.stack([np.arange(-2.0, 3.0), np.zeros(5)], axis=1)
    return [
        Embedded(
            i,
            np.array([p, 0.0]) + spread,
        )
        for i, p in zip(entries.identities, places, strict=True)
    ]


def test_disjoint_splits_pass(tmp_path):
    entries = crossing(tmp_path, 3.0, b"3")
    found = leakage(entries, embedded(entries, 0.0, 1.0, 3.0))
    assert all(verdict(found).values())
    assert found.by_class[0].train_to_train == pytest.approx((1.0, 1.0))
    assert found.by_class[0].test_to_train == pytest.approx((2.0, 2.0))
    # Pairs of five places on a line: four at 1, three at 2, two at 3 and one at 4 hundredths.
    assert found.by_class[0].resampling == pytest.approx((0.02, 0.04))
    assert found.by_class[0].ratio == pytest.approx((50.0, 50.0))


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
    assert [n.identity for n in found.neighbours] == ["bird_c"] and found.copies == ()
    assert found.neighbours[0].ratio == pytest.approx(10.0)
    assert found.out_of_split == ("c",) and not verdict(found)["sequences keep to their split"]


def test_a_missing_asset_is_named(tmp_path):
    entries = crossing(tmp_path, 0.0, b"3")
    (tmp_path / "bird_b.usdc").unlink()
    with pytest.raises(UserError, match=r"bird_b\.usdc"):
        leakage(entries, embedded(entries, 0.0, 1.0, 2.0))


@pytest.mark.parametrize("label", ["bird", "helicopter"])
def test_a_copy_is_found_and_another_kind_is_not(label, tmp_path):
    """One individual sampled twice under two names is a copy; one of a held-out family is none."""
    first, second, *_ = [i for i in identities("train") if i.label == label]
    other = next(i for i in identities("test") if i.label == label)
    entries, shapes = [], []
    for number, (identity, split) in enumerate([(first, "train"), (second, "train"), (first, "test"), (other, "val")]):
        path = tmp_path / f"{number}.usdc"
        path.write_bytes(str(number).encode())
        entries.append(IdentityEntry(str(number), label, str(number), split, path, "Apache-2.0", "aerojax"))
        samplings = samplings_of(build_animated(identity), np.random.default_rng(number), 3)
        shapes.append(Embedded(entries[-1], samplings))
    found = leakage(DatasetEntries((tmp_path,), (), tuple(entries)), shapes)
    assert [(n.identity, n.nearest) for n in found.copies] == [("2", "0")]
    ratios = {n.identity: n.ratio for n in found.neighbours}
    assert ratios["2"] <= 1.0 < ratios["3"]
