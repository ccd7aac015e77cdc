"""Outliers: closed meshes of the stated size, individuals that differ, kinds that are in no split of the data set."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES, UNKNOWN
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import identities, outliers
from aerojax.simulate.assets.outliers.individuals import LENGTHS, outlier_asset
from aerojax.simulate.assets.outliers.kinds import KINDS
from aerojax.simulate.assets.outliers.sheets import THIN, half_sheet, sheet


def volume(mesh) -> float:
    a, b, c = (mesh.points[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


@pytest.mark.parametrize("kind", KINDS)
def test_meshes_are_closed_and_of_the_stated_size(kind):
    for seed in range(3):
        (part,) = outlier_asset(kind, seed).parts
        edges = part.mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        assert {tuple(e) for e in edges.tolist()} == {tuple(e) for e in edges[:, ::-1].tolist()}  # both ways each
        assert volume(part.mesh) > 0 and np.isfinite(part.mesh.points).all()
        low, high = part.mesh.points.min(axis=0), part.mesh.points.max(axis=0)
        assert LENGTHS[0] - 1e-9 <= (high - low).max() <= LENGTHS[1] + 1e-9
        np.testing.assert_allclose(low + high, 0.0, atol=1e-9)


def test_an_individual_follows_from_its_name_and_differs_from_others():
    first, second = (one for one in outliers("test", 2) if one.family == "box")
    again = build_animated(first).vertices_at(0.0)
    np.testing.assert_array_equal(build_animated(first).vertices_at(3.0), again)  # nothing of it moves
    other = build_animated(second).vertices_at(0.0)
    assert again.shape != other.shape or not np.allclose(again, other)


def test_kinds_choose_or_measure_and_are_in_no_split_of_the_data_set():
    val, test = (outliers(split, 2) for split in ("val", "test"))
    assert {one.family for one in val} | {one.family for one in test} == set(KINDS)
    assert not {one.family for one in val} & {one.family for one in test}
    assert {"ball", "box", "balloon", "kite", "leaf"} <= {one.family for one in test}
    assert {one.label for one in (*val, *test)} == {UNKNOWN} and outliers("val", 2)[: len(val) // 2] == outliers("val")
    published = [one for split in ("train", "val", "test") for one in identities(split)]
    assert len(published) == 91 and {one.label for one in published} == set(CLASSES)
    with pytest.raises(UserError, match="outliers are never learnt from"):
        outliers("train")
    with pytest.raises(UserError, match="per_kind is -1"):
        outliers("val", -1)


def test_a_sheet_is_thin_and_symmetric_about_its_midrib():
    x, width = np.linspace(-0.5, 0.5, 5), np.array([0.1, 0.2, 0.3, 0.2, 0.1])
    area = float(np.trapezoid(width, x))
    half = half_sheet(x, width, fold=0.0, bend=0.0, twist=0.0)
    assert volume(half) == pytest.approx(2 * THIN * area, rel=1e-9)
    whole = sheet(x, width, fold=0.3, bend=0.4, twist=0.0)
    assert whole.points[:, 1].min() == pytest.approx(-0.3) and whole.points[:, 1].max() == pytest.approx(0.3)
    at_edge = whole.points[np.isclose(whole.points[:, 1], 0.3)]
    np.testing.assert_allclose(np.abs(at_edge[:, 2] - 0.3 * 0.3), THIN, atol=1e-12)  # at x = 0 nothing is bent
