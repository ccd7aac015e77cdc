"""Statistics of data sets against hand-computed and printed figures."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import cv2
import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.data.manifest import DatasetEntries, IdentityEntry, SequenceEntry
from aerojax.evaluate.dataset_qa.balance import compositions, entropy_ratio, gini_simpson
from aerojax.evaluate.dataset_qa.description import to_json
from aerojax.evaluate.dataset_qa.leakage import Embedded, leakage, verdict
from aerojax.evaluate.dataset_qa.motion import (
    chamfer_distance,
    chamfer_matrix,
    class_motions,
    detect_period,
    lag_curve,
    motion_of,
    spectrum,
)
from aerojax.evaluate.dataset_qa.shapes import draw_surface_points, face_areas, shape_embedding
from aerojax.view.dataset.plots import Curve, Labels, bar_plot, curve_plot, heat_png, standalone
from aerojax.view.dataset.tables import Table, html_table, markdown

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
CUBE_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


@pytest.mark.parametrize(
    ("counts", "entropy", "gini"),
    [
        # Table 6.3 of the thesis: bird, drone, helicopter, airplane.
        ((9000, 9000, 4800, 4800), 0.966, 0.727),
        ((3600, 4200, 2400, 2400), 0.978, 0.735),
        ((4800, 4800, 2400, 2400), 0.959, 0.722),
        ((2700, 2700, 1440, 1440), 0.966, 0.727),
        ((1080, 1260, 720, 720), 0.978, 0.735),
        ((960, 960, 480, 480), 0.959, 0.722),
        ((5, 5, 5, 5), 1.0, 0.75),
        ((5, 0, 0, 0), 0.0, 0.0),
        ((0, 0, 0, 0), 0.0, 0.0),
    ],
)
def test_balance_is_what_the_thesis_prints(counts, entropy, gini):
    assert entropy_ratio(counts) == pytest.approx(entropy, abs=5e-4)
    assert gini_simpson(counts) == pytest.approx(gini, abs=5e-4)


def sequence(name: str, label: str, split: str, frames: int, *others: str) -> SequenceEntry:
    identity = f"{label}_{name}"
    objects = (identity, *others)
    return SequenceEntry(Path(name), name, label, identity, split, "sim1", frames, 30.0, objects, 4, 16.0)


def test_composition_counts_moments_of_the_first_object():
    entries = (
        sequence("a", "bird", "train", 30, "drone_x"),
        sequence("a", "bird", "train", 30),
        sequence("b", "helicopter", "train", 10),
        sequence("c", "drone", "test", 5),
    )
    train, test = compositions(entries)
    assert (train.identities, train.sequences, train.frames) == (2, 3, 70)
    assert train.frames_by_class == (60, 0, 0, 10)  # bird, drone, airplane, helicopter
    assert (test.split, test.frames_by_class) == ("test", (0, 5, 0, 0))


def test_chamfer_distance_by_hand():
    one = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    other = np.array([[0.0, 0, 0], [0.0, 2.0, 0], [1.0, 0, 0]])
    # There 0 and 0; back 0, 2 and 0.
    assert chamfer_distance(one, other) == pytest.approx(0.5 * (0 + 2 / 3))
    assert chamfer_distance(one, one) == 0.0


def swinging(period: float, frames: int = 30, reach: float = 0.1) -> np.ndarray:
    """A row of points whose one end swings."""
    x = np.linspace(0.0, 1.0, 40)
    height = reach * np.sin(2 * np.pi * np.arange(frames)[:, None] / period) * x
    return np.stack([np.broadcast_to(x, height.shape), height, np.zeros_like(height)], axis=2)


@pytest.mark.parametrize("period", [5.0, 7.5, 8.0, 12.0, 16.0])
def test_period_of_a_swing(period):
    assert detect_period(lag_curve(chamfer_matrix(swinging(period)))) == pytest.approx(period, abs=0.35)


def test_period_does_not_depend_on_the_start_but_the_first_row_does():
    clouds = np.concatenate([swinging(9.0, 40)])
    early, late = (chamfer_matrix(clouds[start : start + 30]) for start in (0, 2))
    assert np.abs(early[0] - late[0]).max() > 0.01
    assert detect_period(lag_curve(early)) == pytest.approx(detect_period(lag_curve(late)), abs=0.2)


def test_no_period_where_nothing_moves_or_returns():
    assert detect_period(lag_curve(chamfer_matrix(swinging(8.0, reach=0.0)))) is None
    assert detect_period(np.linspace(0.0, 1.0, 30)) is None
    assert detect_period(np.zeros(2)) is None


def test_spectrum_has_sixteen_bins_without_mean():
    magnitude = spectrum(3.0 + np.cos(2 * np.pi * np.arange(30) * 5 / 30))
    assert magnitude.shape == (16,)
    np.testing.assert_allclose(magnitude, 0.5 * (np.arange(16) == 5), atol=1e-12)


def test_motion_of_classes():
    motions = [
        motion_of("bird_a", "bird", swinging(10.0)),
        motion_of("bird_b", "bird", swinging(6.0)),
        motion_of("drone_a", "drone", swinging(8.0, reach=0.0)),
    ]
    bird, drone = class_motions(motions)
    assert (bird.identities, bird.periodic) == (2, 2)
    assert bird.period == pytest.approx(8.0, abs=0.3)
    assert (drone.periodic, drone.period, drone.peak) == (0, None, None)
    np.testing.assert_allclose(bird.mean, (motions[0].to_first + motions[1].to_first) / 2)
    assert class_motions([]) == ()


def test_surface_points_are_uniform_over_the_area():
    points = draw_surface_points(CUBE, CUBE_FACES, 6000, np.random.default_rng(0)).at(CUBE, CUBE_FACES)
    assert face_areas(CUBE, CUBE_FACES).sum() == pytest.approx(6.0)
    on_face = np.stack([np.abs(points - side) < 1e-12 for side in (0.0, 1.0)]).sum(axis=1)
    np.testing.assert_allclose(on_face, 1000, atol=150)
    np.testing.assert_allclose(points.mean(axis=0), 0.5, atol=0.02)


def embedding_of(vertices: np.ndarray, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = draw_surface_points(vertices, CUBE_FACES, 8000, rng).at(vertices, CUBE_FACES)
    return shape_embedding(points[None], float(face_areas(vertices, CUBE_FACES).sum()), rng)


def test_embedding_does_not_see_rotation_and_scale_but_shape():
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    slab = CUBE * [1.0, 0.7, 0.2]
    plain, same, turned, other = (
        embedding_of(v, s) for v, s in ((slab, 0), (slab, 1), (5.0 * slab @ turn.T, 0), (CUBE, 0))
    )
    np.testing.assert_allclose(plain, turned, atol=1e-9)
    assert np.linalg.norm(plain - same) < 0.03
    assert np.linalg.norm(plain - other) > 0.2  # the negative control


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


def test_plots_are_well_formed_files():
    curve = Curve(np.arange(5.0), np.array([0.0, 1, 2, 1, 0]), np.full(5, 0.3))
    labels = Labels('a < "b"', "x & y", "z")
    for plot in (
        curve_plot(labels, {"bird": curve}, marks=[2.0], colour=3),
        bar_plot(labels, ["≤ 1", "larger"], {"bird": [0.25, 0.75], "drone": [0.0, 1.0]}),
        curve_plot(labels, {"empty": Curve(np.zeros(1), np.zeros(1))}),
    ):
        root = ElementTree.fromstring(standalone(plot))
        assert root.attrib["aria-label"] == 'a < "b"'
    bars = bar_plot(labels, ["1", "2"], {"bird": [0.5, 1.0]})
    heights = [float(rect.attrib["height"]) for rect in ElementTree.fromstring(bars).iter("rect")][:2]
    assert heights[1] == pytest.approx(2 * heights[0], abs=0.11)


def test_heat_map_is_bright_where_much_is():
    heat = np.zeros((4, 6))
    heat[1, 2] = 3.0
    picture = cv2.imdecode(np.frombuffer(heat_png(heat, cell=5), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture.shape == (20, 30)
    assert picture[7, 12] > 200 and picture[0, 0] < 10
    assert heat_png(np.zeros((2, 2))).startswith(b"\x89PNG")


def test_tables_as_text_and_page():
    table = Table("T", "n", ("a", "b"), (("1", "<x|y>"),))
    assert "| 1 | <x\\|y> |" in markdown([table], title="all")
    assert "<td>&lt;x|y&gt;</td>" in html_table(table)


def test_json_has_no_infinities():
    assert to_json({"a": (np.nan, np.array([1.0, np.inf])), "b": True, "c": "x", 1: 2}) == {
        "a": [None, [1.0, None]],
        "b": True,
        "c": "x",
        "1": 2,
    }
