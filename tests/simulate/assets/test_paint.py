"""Patterns, atlases and materials: no seams, no bleeding, colours where they belong, the same bytes every time."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade

from aerojax.core.errors import UserError
from aerojax.simulate.assets.mesh import lofts, shapes
from aerojax.simulate.assets.mesh.parts import Part, Spin
from aerojax.simulate.assets.paint import atlas as textures
from aerojax.simulate.assets.paint import materials as coats
from aerojax.simulate.assets.paint import patterns
from aerojax.simulate.assets.variation import SCHEMES, SLOTS, draw_palette
from aerojax.simulate.usd.authoring import Asset, write_asset

PLANE = Asset(
    (
        Part("hull", shapes.ellipsoid((0.0, 0.0, 0.0), (0.5, 0.1, 0.1))),
        Part("canopy", shapes.ellipsoid((0.2, 0.0, 0.1), (0.1, 0.05, 0.05)), 1),
        Part("wings", shapes.box((0.0, 0.0, 0.05), (0.2, 1.0, 0.02)), 0),
        Part(
            "propeller",
            lofts.rotor(lofts.RotorShape(2, 0.2, 0.03, 0.02)),
            3,
            Spin((0.5, 0.0, 0.0), (1.0, 0.0, 0.0), 20.0),
        ),
        Part("disc", shapes.ring((0.5, 0.0, 0.0), 0.2, 0.01, 0.01), 3, opacity=0.25),
    )
)


def bilinear(image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Filter an image at texel coordinates, clamped at its border."""
    x, y = x - 0.5, y - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    total = np.zeros((len(x), image.shape[2]))
    for i in (0, 1):
        for j in (0, 1):
            weight = (1 - abs(x - column - j)) * (1 - abs(y - row - i))
            rows, columns = (row + i).clip(0, image.shape[0] - 1), (column + j).clip(0, image.shape[1] - 1)
            total += weight[:, None] * image[rows, columns]
    return total


def baked_positions(mesh: shapes.Mesh, spoil: int = 0) -> float:
    """Bake positions as colours and compare filtered samples with the truth; the largest error, metres.

    Interpolation of an affine function is exact, so any texel of another triangle shows. `spoil` shifts the samples.
    """
    atlas = textures.lay_out(mesh)
    texels = textures.texels_of(atlas)
    values = textures.interpolate(texels, mesh.points[mesh.faces], slice(None))
    image = np.full((atlas.height, textures.WIDTH, 3), np.inf)
    image[texels.row, texels.column] = values
    rng = np.random.default_rng(0)
    face = rng.integers(0, len(mesh.faces), 4000)
    share = rng.dirichlet((0.3, 0.3, 0.3), 4000)  # many near edges and corners
    at = np.einsum("ij,ijk->ik", share, atlas.corner[face])
    truth = np.einsum("ij,ijk->ik", share, mesh.points[mesh.faces[face]])
    image[~np.isfinite(image)] = 1e3
    return float(np.abs(bilinear(image, at[:, 0] + spoil, at[:, 1]) - truth).max())


@pytest.mark.parametrize("name", ["hull", "wings", "propeller"])
def test_filtering_reads_no_other_triangle(name):
    mesh = next(p.mesh for p in PLANE.parts if p.name == name)
    assert baked_positions(mesh) < 1e-9
    assert baked_positions(mesh, spoil=2) > 1e-2  # the check can fail


def test_an_atlas_is_small_and_follows_size():
    whole = shapes.merge(*(p.mesh for p in PLANE.parts))
    atlas = textures.lay_out(whole)
    assert atlas.height <= textures.WIDTH
    assert atlas.st().min() > 0 and atlas.st().max() < 1
    tiny = textures.lay_out(shapes.scaled(whole, 0.05))
    assert tiny.height < atlas.height
    many = shapes.merge(*[shapes.ellipsoid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 40, 40)] * 6)  # 18,500 large triangles
    assert textures.lay_out(many).height < 1.2 * textures.WIDTH


def test_texels_belong_to_one_triangle():
    atlas = textures.lay_out(PLANE.parts[0].mesh)
    texels = textures.texels_of(atlas)
    flat = texels.row * textures.WIDTH + texels.column
    assert len(np.unique(flat)) == len(flat)
    assert len(np.unique(texels.face)) == len(atlas.corner)


def test_noise_is_smooth_and_covers_the_range():
    points = np.random.default_rng(0).uniform(-20, 20, (20000, 3))
    noise = patterns.value_noise(points, 7)
    assert 0 <= noise.min() < 0.1 and 0.9 < noise.max() <= 1 and abs(noise.mean() - 0.5) < 0.02
    near = patterns.value_noise(points + 1e-4, 7)
    assert np.abs(near - noise).max() < 1e-3
    assert np.abs(patterns.value_noise(points, 8) - noise).mean() > 0.1
    lattice = np.array([[1.0, -2.0, 3.0]])  # on the lattice the noise is the hash itself, from either side
    assert patterns.value_noise(lattice, 7) == pytest.approx(patterns.value_noise(lattice - 1e-9, 7), abs=1e-6)


def _surface(position: np.ndarray, normal=(0.0, 0.0, 1.0)) -> patterns.Surface:
    half = np.array([0.5, 0.5])
    normals = np.repeat([normal], len(position), axis=0)
    return patterns.Surface(position, normals, position[:, 0] / half[0], np.abs(position[:, 1]) / half[1])


def _layer(kind: str, **changes) -> patterns.Layer:
    return replace(patterns.Layer(kind, 1, 0.5, 0.5, 8.0, 3, 1.0), **changes)


@pytest.mark.parametrize("kind", sorted(patterns.MASKS))
def test_every_layer_covers_a_part_of_the_object(kind):
    position = np.random.default_rng(1).uniform(-0.5, 0.5, (20000, 3)) * [1, 1, 0.2]
    normal = (0.0, 0.0, -1.0) if kind == "belly" else (0.0, 0.0, 1.0)
    cover = patterns.MASKS[kind](_layer(kind), _surface(position, normal))
    assert cover.min() >= 0 and cover.max() <= 1
    assert cover.mean() > 0.001 and (cover.mean() < 0.9 or kind == "belly")


def test_layers_lie_where_they_say():
    at = np.array([[0.0, 0.1, 0.0], [0.0, 0.49, 0.0], [0.45, 0.0, 0.0], [-0.45, 0.0, 0.0]])
    assert patterns.MASKS["tips"](_layer("tips"), _surface(at)) == pytest.approx([0, 1, 0, 0])
    assert patterns.MASKS["hood"](_layer("hood"), _surface(at)) == pytest.approx([0, 0, 1, 0])
    assert patterns.MASKS["rump"](_layer("rump"), _surface(at)) == pytest.approx([0, 0, 0, 1])
    assert patterns.MASKS["belly"](_layer("belly"), _surface(at, (0.0, 0.0, 1.0))).max() == 0
    assert patterns.MASKS["belly"](_layer("belly"), _surface(at, (0.0, 0.0, -1.0))).min() == 1


def test_palettes_are_many_and_within_range():
    palettes = [draw_palette(seed) for seed in range(300)]
    srgb = np.stack([p.srgb for p in palettes])
    assert srgb.shape == (300, SLOTS, 3) and srgb.min() >= 0.02 and srgb.max() <= 0.97
    assert len(np.unique(srgb[:, 0], axis=0)) > 290
    assert all(len(set(colours)) == len(colours) > SLOTS for colours in SCHEMES.values())


def test_unpatterned_roles_keep_their_colour():
    paint = patterns.draw_paint(5)
    plain = replace(paint, patterned=np.zeros(patterns.ROLES, bool), grain=0.0)
    position = np.random.default_rng(1).uniform(-0.5, 0.5, (50, 3))
    for role in range(patterns.ROLES):
        seen = patterns.colours(plain, role, _surface(position))
        assert seen == pytest.approx(np.repeat(paint.palette.srgb[paint.slot_of[role]][None], 50, axis=0))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("painted") / "plane.usdc"
    write_asset(path, PLANE, 11)
    return path


def test_materials_bind_the_texture(written):
    stage = Usd.Stage.Open(str(written))
    roughness = {}
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh):
            continue
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        surface = material.ComputeSurfaceSource()[0]
        roughness[prim.GetPath().name if prim.GetName() != "mesh" else "propeller"] = surface.GetInput(
            "roughness"
        ).Get()
        texture = UsdShade.Shader(surface.GetInput("diffuseColor").GetConnectedSources()[0][0].source)
        assert texture.GetIdAttr().Get() == "UsdUVTexture"
        assert texture.GetInput("file").Get().resolvedPath == str(written.with_suffix(".png"))
        st = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
        assert st.GetInterpolation() == "faceVarying"
        assert len(st.Get()) == len(UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get())
    assert roughness["canopy"] == pytest.approx(coats.GLASS_ROUGHNESS) and roughness["hull"] > 0.29
    disc = stage.GetPrimAtPath("/plane/disc")
    assert UsdGeom.Mesh(disc).GetDisplayOpacityAttr().Get() == pytest.approx([0.25])
    opacity = UsdShade.MaterialBindingAPI(disc).ComputeBoundMaterial()[0].ComputeSurfaceSource()[0].GetInput("opacity")
    assert opacity.Get() == pytest.approx(0.25)


def test_the_file_shows_the_pattern(written):
    """Texture read through `st` equals the pattern evaluated at the surface; display colours are its means."""
    stage, image = Usd.Stage.Open(str(written)), cv2.imread(str(written.with_suffix(".png")))[..., ::-1] / 255
    prim = stage.GetPrimAtPath("/plane/wings")
    mesh, paint = PLANE.parts[2].mesh, patterns.draw_paint(11)
    st = np.array(UsdGeom.PrimvarsAPI(prim).GetPrimvar("st").Get()).reshape(-1, 3, 2)
    rng = np.random.default_rng(2)
    face, share = rng.integers(0, len(mesh.faces), 3000), rng.dirichlet((1, 1, 1), 3000)
    at = np.einsum("ij,ijk->ik", share, st[face])
    position = np.einsum("ij,ijk->ik", share, mesh.points[mesh.faces[face]])
    normal = coats.corner_normals(mesh).reshape(-1, 3, 3)[face, 0]
    surface = patterns.Surface(position, normal, position[:, 0] / 0.55, np.abs(position[:, 1]) / 0.5)
    fixed = np.concatenate([p.mesh.points for p in PLANE.parts if p.spin is None])
    middle, half = (fixed.min(0) + fixed.max(0))[0] / 2, np.ptp(fixed[:, 0]) / 2
    expected = patterns.colours(paint, 0, replace(surface, along=(position[:, 0] - middle) / half))
    seen = bilinear(image, at[:, 0] * image.shape[1], (1 - at[:, 1]) * image.shape[0])
    assert np.median(np.abs(seen - expected)) < 0.01
    assert np.mean(np.abs(seen - expected)) < 0.03
    display = UsdGeom.Mesh(prim).GetDisplayColorPrimvar().ComputeFlattened()
    means = [textures.linear_from_srgb(seen[face == i]).mean(0) for i in range(len(mesh.faces))]
    large = [i for i in range(len(mesh.faces)) if (face == i).sum() > 30]
    assert np.abs(np.array(display)[large] - np.array(means)[large]).max() < 0.06


def test_an_unwritable_folder_is_named(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(UserError, match=r"plane\.png"):
        write_asset(blocked / "plane.usdc", PLANE, 1)


def test_glass_wears_no_pattern():
    paint = replace(patterns.draw_paint(5), grain=0.0, patterned=np.ones(patterns.ROLES, bool))
    position = np.random.default_rng(1).uniform(-0.5, 0.5, (2000, 3))
    assert np.ptp(patterns.colours(paint, 1, _surface(position), plain=True), axis=0).max() == 0
    assert np.ptp(patterns.colours(paint, 1, _surface(position)), axis=0).max() > 0.05
