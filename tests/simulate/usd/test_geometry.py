"""Meshes of a stage: holes, concave faces, and what contradicts itself."""

from __future__ import annotations

import numpy as np
import pytest
from support.usd_text import write_usda

from aerojax.core.errors import UserError
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

L = "[(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]"


def _load(folder, *lines):
    body = "; ".join(lines)
    text = f'def Mesh "other" {{ TRIANGLE }} def Mesh "a" {{ {body} }} '
    return load_animated_mesh(write_usda(folder / "a.usda", text))


def _area(mesh):
    a, b, c = np.moveaxis(mesh.vertices_at(0.0)[mesh.faces[mesh.part == 1]], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_concave_faces_keep_their_area_and_their_colours(tmp_path):
    """An L of area 3 from its second corner on, and a triangle; each has the colour that it was given."""
    mesh = _load(
        tmp_path,
        f"point3f[] points = {L}",
        "int[] faceVertexCounts = [3, 6]",
        "int[] faceVertexIndices = [0, 1, 2, 1, 2, 3, 4, 5, 0]",
        'color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "uniform" )',
    )
    assert _area(mesh) == pytest.approx(1 + 3)
    assert mesh.albedo[mesh.part == 1].tolist() == [[1, 0, 0]] + [[0, 1, 0]] * 4


def test_holes_stay_open(tmp_path):
    mesh = _load(
        tmp_path,
        f"point3f[] points = {L}",
        "int[] faceVertexCounts = [3, 6]",
        "int[] faceVertexIndices = [0, 1, 2, 1, 2, 3, 4, 5, 0]",
        "int[] holeIndices = [1]",
    )
    assert _area(mesh) == pytest.approx(1)


@pytest.mark.parametrize("lines", [(), (f"point3f[] points = {L}",), ("int[] faceVertexCounts = []",)])
def test_meshes_without_faces_are_not_drawn(tmp_path, lines):
    assert _load(tmp_path, *lines).part_names == ("/other",)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (("int[] faceVertexCounts = [3]", "int[] faceVertexIndices = [0, 1, 2]"), "/a: has faces but no points"),
        (
            (f"point3f[] points = {L}", "int[] faceVertexCounts = [4]", "int[] faceVertexIndices = [0, 1, 2]"),
            "/a: faceVertexCounts sum to 4, but faceVertexIndices are 3",
        ),
        (
            (f"point3f[] points = {L}", "int[] faceVertexCounts = [3]", "int[] faceVertexIndices = [0, 1, 6]"),
            "/a: faceVertexIndices names point 6 of 6",
        ),
        (
            (
                "point3f[] points = [(0, 0, 0), (1, 0, 0), (nan, 0, 0)]",
                "int[] faceVertexCounts = [3]",
                "int[] faceVertexIndices = [0, 1, 2]",
            ),
            "/a: points are not finite numbers",
        ),
        (
            (
                f"point3f[] points = {L}",
                "int[] faceVertexCounts.timeSamples = { 0: [3], 1: [4] }",
                "int[] faceVertexIndices = [0, 1, 2]",
            ),
            "/a: faceVertexCounts change over time, which is not read",
        ),
        (
            (
                f"point3f[] points = {L}",
                "int[] faceVertexCounts = [3]",
                "int[] faceVertexIndices = [0, 1, 2]",
                'color3f[] primvars:displayColor = [(1, 0, 0)] ( interpolation = "vertex" )',
            ),
            "/a: primvar displayColor has 1 values, fewer than its interpolation needs",
        ),
    ],
)
def test_meshes_that_contradict_themselves_are_named(tmp_path, lines, message):
    with pytest.raises(UserError, match=message) as caught:
        _load(tmp_path, *lines)
    assert caught.value.problem.startswith(str(tmp_path / "a.usda"))


def test_points_that_change_their_number_are_named_when_they_do(tmp_path):
    _load(
        tmp_path,
        "int[] faceVertexCounts = [3]",
        "int[] faceVertexIndices = [0, 1, 2]",
        "point3f[] points.timeSamples = { 0: [(0, 0, 0), (1, 0, 0), (0, 1, 0)], 12: [(0, 0, 0)], 24: [(0, 0, 0)] }",
    )
    mesh = load_animated_mesh(tmp_path / "a.usda", called="mine")
    with pytest.raises(UserError, match="mine: /a: points are 1, but 3 at its start, at time code"):
        mesh.vertices_at(0.75)


def test_transforms_that_are_not_finite_are_named(tmp_path):
    _load(
        tmp_path,
        "int[] faceVertexCounts = [3]",
        "int[] faceVertexIndices = [0, 1, 2]",
        "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]",
        "double3 xformOp:translate = (0, inf, 0)",
        'uniform token[] xformOpOrder = ["xformOp:translate"]',
    )
    mesh = load_animated_mesh(tmp_path / "a.usda")
    with pytest.raises(UserError, match=r"a\.usda: /a: its points or a transform are not finite at time code 0"):
        mesh.vertices_at(0.0)
