"""Primitives against hand-computed volumes and extents, and closedness by trimesh."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from aerojax.simulate.assets.mesh import shapes

SOLIDS = {
    "box": shapes.box((1.0, 2.0, 3.0), (0.2, 0.3, 0.4)),
    "tube": shapes.tube((0.0, 0.1, 0.0), (0.5, 0.1, 0.2), 0.05, 0.02),
    "polyline": shapes.polyline_tube([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0)], 0.1),
    "ellipsoid": shapes.ellipsoid((0.0, 0.0, 1.0), (0.3, 0.2, 0.1)),
    "ring": shapes.ring((0.0, 0.0, 0.0), 1.0, 0.2, 0.1),
    "hoop": shapes.hoop((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.5, 0.02),
}


def _solid(mesh: shapes.Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.points, mesh.faces, process=False)


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_wound_outwards(name):
    for piece in _solid(SOLIDS[name]).split(only_watertight=False):
        assert piece.is_watertight
        assert piece.volume > 0
        assert piece.area_faces.min() > 0


def test_hoop_stands_across_its_axis():
    points = SOLIDS["hoop"].points
    assert np.ptp(points[:, 0]) == pytest.approx(0.02)
    assert points.mean(0) == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    reach = np.linalg.norm(points[:, 1:] - [0.0, 1.0], axis=1)
    assert (reach.min(), reach.max()) == pytest.approx((0.49, 0.51))


def test_rotation_about_turns_right_handed():
    turned = shapes.rotation_about((0.0, 0.0, 2.0), 90.0) @ np.array([1.0, 0.0, 0.0])
    assert turned == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    frame = shapes.frame_along(np.array([0.3, -0.2, 0.9]))
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_volumes_equal_the_formulas():
    assert _solid(SOLIDS["box"]).volume == pytest.approx(0.2 * 0.3 * 0.4)
    polygon = 10 / 2 * np.sin(2 * np.pi / 10)  # area of a regular decagon of unit circumradius
    cone_length = np.hypot(0.5, 0.2)
    frustum = polygon * cone_length / 3 * (0.05**2 + 0.05 * 0.02 + 0.02**2)
    assert _solid(SOLIDS["tube"]).volume == pytest.approx(frustum)
    wall = 24 / 2 * np.sin(2 * np.pi / 24) * (1.05**2 - 0.95**2) * 0.2
    assert _solid(SOLIDS["ring"]).volume == pytest.approx(wall)
    fine = shapes.ellipsoid((0.0, 0.0, 0.0), (0.3, 0.2, 0.1), rings=80, sides=80)
    assert _solid(fine).volume == pytest.approx(4 / 3 * np.pi * 0.3 * 0.2 * 0.1, rel=5e-3)
