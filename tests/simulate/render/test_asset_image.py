"""Pictures of one asset: it fills the frame, shows its texture, and the views differ."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.simulate.assets.mesh import shapes
from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.render.asset_image import AssetRenderer, srgb_bytes
from aerojax.simulate.usd.animated_mesh import load_animated_mesh
from aerojax.simulate.usd.authoring import Asset, write_asset
from kernels.rays.raytrace import Lighting

EVEN = Lighting(sun=0.0, sky=1.0, ground=1.0)


@pytest.fixture(scope="module")
def renderer(tmp_path_factory) -> AssetRenderer:
    path = tmp_path_factory.mktemp("picture") / "slab.usdc"
    slab = shapes.box((0.3, 0.1, 0.0), (0.9, 0.5, 0.05))  # off the origin: pictures are centred
    write_asset(path, Asset((Part("slab", slab), Part("fin", shapes.box((0.0, 0.1, 0.1), (0.1, 0.02, 0.2)), 2))), 4)
    return AssetRenderer(load_animated_mesh(path))


def test_the_object_fills_the_frame(renderer):
    seen = renderer.image(0.0, 90.0, 30.0, width=120, height=80, lighting=EVEN)
    assert seen.linear.shape == (80, 120, 3) and seen.coverage.shape == (80, 120)
    columns, rows = np.flatnonzero(seen.coverage.max(axis=0)), np.flatnonzero(seen.coverage.max(axis=1))
    assert 100 <= np.ptp(columns) <= 115 or 66 <= np.ptp(rows) <= 77
    assert seen.coverage.min() == 0 and seen.coverage.max() == 1
    assert (seen.linear[seen.coverage == 0] == 0).all()


def test_pictures_show_the_texture_and_the_backdrop(renderer):
    seen = renderer.image(0.0, 20.0, 60.0, width=120, height=80, lighting=EVEN)
    colours = srgb_bytes(seen.linear)[seen.coverage == 1]
    assert len(np.unique(colours, axis=0)) > 50  # two flat colours without their texture
    over = seen.over(0.25)
    assert over[seen.coverage == 0] == pytest.approx(0.25)
    assert over[seen.coverage == 1] == pytest.approx(seen.linear[seen.coverage == 1])


def test_views_differ(renderer):
    one, two = (renderer.image(0.0, a, 20.0, width=60, height=40, lighting=EVEN).coverage for a in (0.0, 90.0))
    assert np.abs(one - two).mean() > 0.05
