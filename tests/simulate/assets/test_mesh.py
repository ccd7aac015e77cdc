"""Mesh primitives against hand-computed volumes and extents, and closedness by trimesh."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from aerojax.simulate.assets.mesh import lofts, shapes


def _solid(mesh: shapes.Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.points, mesh.faces, process=False)


def _wing() -> shapes.Mesh:
    share = np.linspace(0, 1, 5)
    edge = np.stack([-0.1 * share, 0.5 * share, 0.02 * share], axis=1)
    sections = lofts.Sections(edge, 0.2 - 0.1 * share, np.array([0.0, 0.0, 1.0]), np.full(5, 0.12), 0.04, 3.0)
    return lofts.surface(sections)


SOLIDS = {
    "box": shapes.box((1.0, 2.0, 3.0), (0.2, 0.3, 0.4)),
    "tube": shapes.tube((0.0, 0.1, 0.0), (0.5, 0.1, 0.2), 0.05, 0.02),
    "polyline": shapes.polyline_tube([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0)], 0.1),
    "ellipsoid": shapes.ellipsoid((0.0, 0.0, 1.0), (0.3, 0.2, 0.1)),
    "ring": shapes.ring((0.0, 0.0, 0.0), 1.0, 0.2, 0.1),
    "hoop": shapes.hoop((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.5, 0.02),
    "wing": _wing(),
    "mirrored wing": shapes.mirrored(_wing()),
    "fin": lofts.trapezoid((0.0, 0.0, 0.0), (-0.1, 0.0, 0.3), 0.2, 0.1),
    "body": lofts.body([(0.5, 0.01, 0.01, 0.0), (0.0, 0.1, 0.2, 0.05), (-0.5, 0.01, 0.02, 0.1)], 3.0),
    "rotor": lofts.rotor(lofts.RotorShape(3, 0.4, 0.04, 0.02)),
    "clockwise rotor": lofts.rotor(lofts.RotorShape(2, 0.4, 0.04, 0.02, clockwise=True)),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_wound_outwards(name):
    for piece in _solid(SOLIDS[name]).split(only_watertight=False):
        assert piece.is_watertight
        assert piece.volume > 0
        assert piece.area_faces.min() > 0


def test_a_hole_is_noticed():
    whole = SOLIDS["wing"]
    assert not _solid(shapes.Mesh(whole.points, whole.faces[1:])).is_watertight


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


def test_hoop_stands_across_its_axis():
    points = SOLIDS["hoop"].points
    assert np.ptp(points[:, 0]) == pytest.approx(0.02)
    assert points.mean(0) == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    reach = np.linalg.norm(points[:, 1:] - [0.0, 1.0], axis=1)
    assert (reach.min(), reach.max()) == pytest.approx((0.49, 0.51))


def test_smooth_passes_through_keys_and_never_overshoots():
    x, y = np.array([0.0, 1.0, 2.0, 4.0]), np.array([0.0, 1.0, 1.0, 0.5])
    assert lofts.smooth(x, x, y) == pytest.approx(y)
    between = lofts.smooth(np.linspace(0, 4, 101), x, y)
    assert between.max() <= 1.0 + 1e-12 and between.min() >= 0.0
    assert lofts.smooth(np.array([1.5]), x, y) == pytest.approx([1.0])


def test_aerofoil_has_its_thickness_and_camber():
    outline = lofts.aerofoil(40, 0.12, 0.05)
    upper, lower = outline[:40], outline[40:][::-1]
    assert np.ptp(outline[:, 0]) == pytest.approx(1.0, abs=2e-3)
    assert (upper[:, 1] - lower[:, 1]).max() == pytest.approx(0.12, rel=0.01)
    assert ((upper[:, 1] + lower[:, 1]) / 2).max() == pytest.approx(0.05, rel=0.01)


def test_body_meets_its_keys():
    points = SOLIDS["body"].points
    assert np.ptp(points[:, 0]) == pytest.approx(1.0)
    assert 0.19 < np.ptp(points[:, 1]) <= 0.2 + 1e-9
    assert points[points[:, 0] < -0.499, 2].mean() == pytest.approx(0.1, abs=1e-6)


def test_rotor_blades_are_evenly_spaced_and_lead_the_right_way():
    """Counter-clockwise seen from above, the thick leading edge of the blade on +y points to -x."""
    for clockwise, sign in ((False, -1.0), (True, 1.0)):
        points = lofts.rotor(lofts.RotorShape(1, 1.0, 0.2, 0.2, (0.0, 0.0), clockwise=clockwise)).points
        middle = points[(points[:, 1] > 0.5) & (points[:, 1] < 0.7)]
        front, rear = middle[:, 0].max(), middle[:, 0].min()
        thick_side = middle[np.argmax(np.abs(middle[:, 2])), 0]
        assert np.sign(thick_side - (front + rear) / 2) == sign
    points = lofts.rotor(lofts.RotorShape(3, 1.0, 0.05, 0.05, hub_radius=0.02)).points
    tips = points[np.hypot(points[:, 0], points[:, 1]) > 0.97]
    angles = np.sort(np.degrees(np.arctan2(tips[:, 1], tips[:, 0])) % 120)
    assert np.ptp(angles) < 5


def test_rotation_about_turns_right_handed():
    turned = shapes.rotation_about((0.0, 0.0, 2.0), 90.0) @ np.array([1.0, 0.0, 0.0])
    assert turned == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    frame = shapes.frame_along(np.array([0.3, -0.2, 0.9]))
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)
