"""Every family of every class: size, closedness, motion, colours, validity of the USD file; and the catalogue."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom, UsdValidation

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.splits import SPLITS
from aerojax.simulate.assets import catalogue
from aerojax.simulate.assets.birds.families import draw_bird
from aerojax.simulate.usd.animated_mesh import AnimatedMesh, load_animated_mesh

TABLE = {
    "bird": {"train": 15, "val": 6, "test": 8},
    "drone": {"train": 15, "val": 7, "test": 8},
    "airplane": {"train": 8, "val": 4, "test": 4},
    "helicopter": {"train": 8, "val": 4, "test": 4},
}
"""Class, split, number of identities: thesis Table 6.3."""
ONE_EACH = [i for split in SPLITS for i in catalogue.identities(split)]
NAMES = [i.name for i in ONE_EACH]
each = pytest.mark.parametrize("identity", ONE_EACH, ids=NAMES)
FEW = list({(i.label, i.split): i for i in ONE_EACH}.values())
ROTORCRAFT = [i for i in ONE_EACH if i.label in ("drone", "helicopter")]
BIRDS = [i for i in ONE_EACH if i.label == "bird"]


@pytest.fixture(scope="module")
def asset(tmp_path_factory):
    """Build and load an identity once for all tests of this module."""
    folder = tmp_path_factory.mktemp("assets")

    @cache
    def load(identity: catalogue.Identity) -> AnimatedMesh:
        return load_animated_mesh(catalogue.build_identity(identity, folder))

    load.folder = folder
    return load


def _part(mesh: AnimatedMesh, name: str) -> np.ndarray:
    """Vertex indices of one part."""
    number = next(i for i, path in enumerate(mesh.part_names) if name in path)
    return np.unique(mesh.faces[mesh.part == number])


def _validator() -> UsdValidation.ValidationContext:
    return UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())


@pytest.mark.parametrize("identity", FEW, ids=[i.name for i in FEW])
def test_file_is_valid_usd(identity, asset):
    asset(identity)
    stage = Usd.Stage.Open(str(asset.folder / f"{identity.name}.usdc"))
    assert [e.GetMessage() for e in _validator().Validate(stage)] == []
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            mesh = UsdGeom.Mesh(prim)
            points, normals = np.array(mesh.GetPointsAttr().Get()), np.array(mesh.GetNormalsAttr().Get())
            assert np.array(mesh.GetExtentAttr().Get()) == pytest.approx(np.stack([points.min(0), points.max(0)]))
            assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0, abs=1e-4)


def test_validator_finds_a_broken_file(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "broken.usdc"))
    UsdGeom.Mesh.Define(stage, "/mesh").CreatePointsAttr([(0, 0, 0)])
    assert _validator().Validate(stage)


@each
def test_mesh_is_finite_small_and_closed(identity, asset):
    mesh = asset(identity)
    assert 500 <= len(mesh.faces) <= 6000
    assert mesh.faces.dtype == np.int32 and mesh.albedo.dtype == np.float32 and mesh.part.dtype == np.uint16
    assert mesh.albedo.min() >= 0 and mesh.albedo.max() <= 1
    for seconds in (0.0, 0.37):
        vertices = mesh.vertices_at(seconds)
        assert vertices.dtype == np.float32 and np.isfinite(vertices).all()
        assert np.abs(vertices).max() < 1.3
    rest = mesh.vertices_at(0.0)
    for number in range(len(mesh.part_names)):
        solid = trimesh.Trimesh(rest, mesh.faces[mesh.part == number], process=False)
        assert solid.is_watertight, mesh.part_names[number]
        assert solid.volume > 0, mesh.part_names[number]


@each
def test_size_is_one_metre(identity, asset):
    mesh = asset(identity)
    stage = Usd.Stage.Open(str(asset.folder / f"{identity.name}.usdc"))
    root = stage.GetDefaultPrim().GetPath()
    if identity.label == "bird":  # at rest, wings level: the points as they were authored
        wing = UsdGeom.Mesh(stage.GetPrimAtPath(f"{root}/skin/wing_left"))
        assert np.array(wing.GetPointsAttr().Get())[:, 1].max() == pytest.approx(0.5, abs=1e-5)
    elif identity.label == "airplane":
        assert np.ptp(mesh.vertices_at(0.0)[_part(mesh, "/wings")][:, 1]) == pytest.approx(1.0, abs=1e-5)
    elif identity.label == "helicopter":
        rotors = [i for i, path in enumerate(mesh.part_names) if "rotor" in path]
        fixed = np.unique(mesh.faces[~np.isin(mesh.part, rotors)])
        assert np.ptp(mesh.vertices_at(0.0)[fixed][:, 0]) == pytest.approx(1.0, abs=1e-5)
    else:
        hubs = np.array([p.GetAttribute("xformOp:translate").Get() for p in stage.GetPrimAtPath(root).GetChildren()
                         if p.GetName().startswith("propeller")])  # fmt: skip
        apart = np.linalg.norm(hubs[:, None, :2] - hubs[None, :, :2], axis=-1)
        assert apart.max() == pytest.approx(1.0, abs=1e-5)


@each
def test_animation_loops(identity, asset):
    mesh = asset(identity)
    if mesh.cycle_seconds == 0:
        pytest.skip("nothing moves")
    at = mesh.vertices_at(0.0313)
    assert mesh.vertices_at(0.0313 + 3 * mesh.cycle_seconds) == pytest.approx(at, abs=2e-5)
    assert mesh.vertices_at(0.0313 - mesh.cycle_seconds) == pytest.approx(at, abs=2e-5)
    almost = mesh.vertices_at(mesh.cycle_seconds * (1 - 1e-7))
    assert almost == pytest.approx(mesh.vertices_at(0.0), abs=1e-4)


@pytest.mark.parametrize("identity", ROTORCRAFT, ids=[i.name for i in ROTORCRAFT])
def test_rotors_turn_about_fixed_hubs(identity, asset):
    mesh = asset(identity)
    stage = Usd.Stage.Open(str(asset.folder / f"{identity.name}.usdc"))
    moving = [path for path in mesh.part_names if path.endswith("/mesh")]
    assert moving
    for path in moving:
        hub = np.array(stage.GetPrimAtPath(path).GetParent().GetAttribute("xformOp:translate").Get())
        inside = _part(mesh, path)
        before, after = mesh.vertices_at(0.0)[inside], mesh.vertices_at(0.0021)[inside]
        assert np.linalg.norm(after - hub, axis=1) == pytest.approx(np.linalg.norm(before - hub, axis=1), abs=1e-5)
        reach = np.linalg.norm(before - hub, axis=1).argmax()
        assert np.linalg.norm(after[reach] - before[reach]) > 0.02 * np.linalg.norm(before[reach] - hub)


@pytest.mark.parametrize("identity", BIRDS, ids=[i.name for i in BIRDS])
def test_wings_beat_through_their_stroke(identity, asset):
    mesh = asset(identity)
    parameters = draw_bird(identity.family, np.random.default_rng(identity.seed)).beat
    wing = _part(mesh, "wing_left")
    authored = np.argmax(np.linalg.norm(mesh.vertices_at(0.0)[wing], axis=1))
    flapping = np.linspace(0, parameters.beats / parameters.hertz, 16 * parameters.beats)
    height = np.array([mesh.vertices_at(t)[wing][authored, 2] for t in flapping])
    expected = 0.42 * (np.sin(np.deg2rad(parameters.rise)) + np.sin(np.deg2rad(parameters.fall)))
    expected *= np.cos(np.deg2rad(parameters.stroke_plane))
    assert 0.5 * expected < np.ptp(height) < 1.5 * expected


@pytest.mark.parametrize("identity", BIRDS[:3], ids=[i.name for i in BIRDS[:3]])
def test_birds_stay_symmetric(identity, asset):
    mesh = asset(identity)
    vertices = mesh.vertices_at(0.11)
    left, right = vertices[_part(mesh, "wing_left")], vertices[_part(mesh, "wing_right")]
    assert right * np.array([1, -1, 1]) == pytest.approx(left, abs=1e-5)


def test_same_seed_same_file(tmp_path):
    for identity in ONE_EACH[:4]:
        one = catalogue.build_identity(identity, tmp_path / "a")
        two = catalogue.build_identity(identity, tmp_path / "b")
        for suffix in (".usdc", ".png"):
            assert one.with_suffix(suffix).read_bytes() == two.with_suffix(suffix).read_bytes()
    other = dataclasses.replace(ONE_EACH[0], seed=ONE_EACH[0].seed + 1)
    assert catalogue.build_identity(other, tmp_path / "c").read_bytes() != (tmp_path / "a" / one.name).read_bytes()


def test_existing_files_are_kept(tmp_path):
    path = tmp_path / f"{ONE_EACH[0].name}.usdc"
    path.write_bytes(b"mine")
    path.with_suffix(".png").write_bytes(b"mine too")
    assert catalogue.build_identity(ONE_EACH[0], tmp_path) == path
    assert path.read_bytes() == b"mine" and path.with_suffix(".png").read_bytes() == b"mine too"


def test_a_stage_without_its_texture_is_built_again(tmp_path):
    path = catalogue.build_identity(ONE_EACH[0], tmp_path)
    whole = path.read_bytes(), path.with_suffix(".png").read_bytes()
    path.with_suffix(".png").unlink()
    catalogue.build_identity(ONE_EACH[0], tmp_path)
    assert (path.read_bytes(), path.with_suffix(".png").read_bytes()) == whole


def test_no_partial_files_remain(tmp_path):
    catalogue.build_identity(ONE_EACH[0], tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"{ONE_EACH[0].name}.png", f"{ONE_EACH[0].name}.usdc"]


def test_splits_share_nothing():
    splits = {s: catalogue.identities(s, 33) for s in SPLITS}
    for field in ("name", "seed"):
        values = [getattr(i, field) for members in splits.values() for i in members]
        assert len(set(values)) == len(values)
    kinds = [{(i.label, i.family) for i in members} for members in splits.values()]
    assert not (kinds[0] & kinds[1] or kinds[0] & kinds[2] or kinds[1] & kinds[2])


def test_identities_are_balanced_interleaved_and_extendable():
    few, many = catalogue.identities("train", 8), catalogue.identities("train", 32)
    assert many[: len(few)] == few
    for members in (few, many):
        assert {label: sum(i.label == label for i in members) for label in CLASSES} == dict.fromkeys(
            CLASSES, len(members) // 4
        )
    assert [i.label for i in few[:4]] == list(CLASSES)
    drones = [i.family for i in many if i.label == "drone"]
    kinds = TABLE["drone"]["train"]
    assert len(set(drones[:kinds])) == kinds and drones[:5] == drones[kinds : kinds + 5]


def test_more_individuals_extend_the_table():
    for split in SPLITS:
        one, three = catalogue.identities(split), catalogue.identities(split, per_family=3)
        assert len(three) == 3 * len(one) and set(one) < set(three)
        assert {i.name for i in one} == {i.name for i in three if i.name.endswith("_00")}


def test_table_of_the_data_set():
    """91 identities in the counts of thesis Table 6.3; no family in two splits; no name twice."""
    found = {split: catalogue.identities(split) for split in SPLITS}
    for label, counts in TABLE.items():
        assert {s: sum(i.label == label for i in members) for s, members in found.items()} == counts, label
    everyone = [i for members in found.values() for i in members]
    assert len(everyone) == len({i.name for i in everyone}) == len({(i.label, i.family) for i in everyone}) == 91


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda path: catalogue.identities("dev", 1), "split is 'dev'"),
        (lambda path: catalogue.identities("train", -1), "per_class is -1"),
        (lambda path: catalogue.identities("train", per_family=-2), "per_family is -2"),
        (lambda path: catalogue.identities("train", 3, per_family=2), "both set"),
        (lambda path: catalogue.build_identity(catalogue.Identity("x", "bird", "dodo", 1, "train"), path), "dodo"),
        (lambda path: catalogue.build_identity(catalogue.Identity("x", "kite", "gull", 1, "train"), path), "kite"),
    ],
)
def test_mistakes_are_named(call, word, tmp_path):
    with pytest.raises(UserError, match=word):
        call(tmp_path)
