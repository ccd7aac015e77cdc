"""Bodies, aerofoil surfaces, fans and rotors: closed, through their keys, the right way round."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from aerojax.simulate.assets.mesh import lofts, shapes


def _wing() -> shapes.Mesh:
    share = np.linspace(0, 1, 5)
    edge = np.stack([-0.1 * share, 0.5 * share, 0.02 * share], axis=1)
    sections = lofts.Sections(edge, 0.2 - 0.1 * share, np.array([0.0, 0.0, 1.0]), np.full(5, 0.12), 0.04, 3.0)
    return lofts.surface(sections)


SOLIDS = {
    "wing": _wing(),
    "mirrored wing": shapes.mirrored(_wing()),
    "fin": lofts.trapezoid((0.0, 0.0, 0.0), (-0.1, 0.0, 0.3), 0.2, 0.1),
    "body": lofts.body([(0.5, 0.01, 0.01, 0.0), (0.0, 0.1, 0.2, 0.05), (-0.5, 0.01, 0.02, 0.1)], 3.0),
    "rotor": lofts.rotor(lofts.RotorShape(3, 0.4, 0.04, 0.02)),
    "clockwise rotor": lofts.rotor(lofts.RotorShape(2, 0.4, 0.04, 0.02, clockwise=True)),
}


def _solid(mesh: shapes.Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.points, mesh.faces, process=False)


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_wound_outwards(name):
    for piece in _solid(SOLIDS[name]).split(only_watertight=False):
        assert piece.is_watertight
        assert piece.volume > 0
        assert piece.area_faces.min() > 0


def test_a_hole_is_noticed():
    whole = SOLIDS["wing"]
    assert not _solid(shapes.Mesh(whole.points, whole.faces[1:])).is_watertight


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


def test_fan_is_closed_and_notched_where_it_ends_early():
    angle = np.linspace(-30.0, 30.0, 7)
    outer = np.where(angle == 0, 0.5, 1.0)
    sheet = lofts.fan(angle, 0.1, outer, (0.02, 0.01))
    solid = trimesh.Trimesh(sheet.points, sheet.faces, process=False)
    assert solid.is_watertight and solid.volume > 0
    assert sheet.points[np.abs(sheet.points[:, 1]) < 1e-9, 0].min() == pytest.approx(-0.5)
    assert np.linalg.norm(sheet.points[:, :2], axis=1).max() == pytest.approx(1.0)
