"""Texture atlases: no seams, no bleeding, sizes that follow the mesh."""

from __future__ import annotations

import numpy as np
import pytest
from support.painted_assets import PLANE, bilinear

from aerojax.simulate.assets.mesh import shapes
from aerojax.simulate.assets.paint import atlas as textures


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
