"""What is drawn and where: purposes, visibility, instances and instancers, by numbers by hand."""

from __future__ import annotations

import numpy as np
import pytest
from support.model_imports import import_model
from support.usd_text import METRIC, write_usda

from aerojax.core.errors import UserError
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

FIELDS = METRIC + "timeCodesPerSecond = 10; startTimeCode = 0; endTimeCode = 10; "


def _load(folder, text):
    return load_animated_mesh(write_usda(folder / "model.usda", text, FIELDS))


def _firsts(mesh, seconds=0.0):
    """The first vertex of every part."""
    return mesh.vertices_at(seconds)[::3].round(5).tolist()


def test_guides_and_proxies_are_not_drawn(tmp_path):
    """A purpose holds for what lies below, unless that has its own."""
    mesh = _load(
        tmp_path,
        """def Xform "Root" {
          def Mesh "plain" { TRIANGLE }
          def Mesh "final" { uniform token purpose = "render"; TRIANGLE }
          def Xform "rig" {
            uniform token purpose = "guide"
            def Mesh "handle" { TRIANGLE }
            def Mesh "kept" { uniform token purpose = "render"; TRIANGLE }
          }
          def Mesh "coarse" { uniform token purpose = "proxy"; TRIANGLE }
          def PointInstancer "marks" {
            uniform token purpose = "guide"
            point3f[] positions = [(0, 0, 0)]
            int[] protoIndices = [0]
            rel prototypes = </Root/marks/mark>
            def Mesh "mark" { TRIANGLE }
          }
        }""",
    )
    assert [name.rpartition("/")[2] for name in mesh.part_names] == ["plain", "final", "kept"]


INSTANCER = """def Xform "Root" {
  def Mesh "body" { TRIANGLE }
  def Xform "mast" {
    double3 xformOp:translate = (0, 0, 100)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def PointInstancer "rotors" (MASKED) {
      point3f[] positions = [(10, 0, 0), (20, 0, 0), (30, 0, 0), (40, 0, 0)]
      quath[] orientations = [(1, 0, 0, 0), (0.70710678, 0, 0, 0.70710678), (1, 0, 0, 0), (1, 0, 0, 0)]
      float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 1), (1, 1, 1)]
      int[] protoIndices = [0, 0, 1, 0]
      int64[] invisibleIds = [3]
      rel prototypes = [</Library/one>, </Library/pair>]
    }
  }
}
class "Library" {
  def Mesh "one" {
    double3 xformOp:translate = (0, 5, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    TRIANGLE
  }
  over "pair" {
    def PointInstancer "inner" {
      point3f[] positions = [(0, 0, 1), (0, 0, 2)]
      int[] protoIndices = [0, 0]
      rel prototypes = </Library/one>
    }
  }
}"""
PLACES = [[0, 0, 0], [10, 5, 100], [10, 0, 100], [30, 5, 101], [30, 5, 102]]


@pytest.mark.parametrize("imported", [False, True])
def test_instancers_draw_every_copy(tmp_path, imported):
    """Of the prototype's own transform, the copy's and the instancer's; nested, of classes, without invisible ids."""
    mesh = _load(tmp_path, INSTANCER.replace("(MASKED)", ""))
    shift = 0
    if imported:
        mesh = import_model(tmp_path, "model.usda", "scale: 1.0, forward: +X")
        shift = mesh.vertices_at(0.0)[0]
    found = mesh.vertices_at(0.0) - shift
    assert found[::3] == pytest.approx(np.array(PLACES, float), abs=1e-2)  # orientations are in half precision
    assert found[6:9] - found[6] == pytest.approx(np.array([[0, 0, 0], [0, 2, 0], [-2, 0, 0]]), abs=1e-2)
    assert [name.partition("[")[2] for name in mesh.part_names[1:]] == [
        "0]/one",
        "1]/one",
        "2]/pair/inner[0]/one",
        "2]/pair/inner[1]/one",
    ]


def test_inactive_copies_are_not_drawn(tmp_path):
    mesh = _load(tmp_path, INSTANCER.replace("MASKED", "inactiveIds = [0, 2]"))
    assert len(mesh.part_names) == 2


def test_copies_move_and_vanish_over_time(tmp_path):
    """A copy that is out of sight has all its vertices in one place of one that is not."""
    mesh = _load(
        tmp_path,
        """def PointInstancer "Root" {
          point3f[] positions.timeSamples = { 0: [(0, 0, 0), (10, 0, 0)], 10: [(0, 0, 4), (10, 0, 8)] }
          int[] protoIndices = [0, 0]
          int64[] invisibleIds.timeSamples = { 0: [], 5: [1] }
          rel prototypes = </Root/one>
          def Mesh "one" { TRIANGLE }
        }""",
    )
    assert _firsts(mesh, 0.25) == [[0, 0, 1], [10, 0, 2]]
    assert mesh.vertices_at(0.75) == pytest.approx(
        np.array([[0, 0, 3], [1, 0, 3], [0, 1, 3]] + [[0, 0, 3]] * 3), abs=1e-5
    )


def test_visibility_is_that_of_the_moment(tmp_path):
    mesh = _load(
        tmp_path,
        """def Xform "Root" {
          def Xform "blinking" {
            token visibility.timeSamples = { 0: "invisible", 5: "inherited" }
            def Mesh "lamp" {
              double3 xformOp:translate = (9, 9, 9)
              uniform token[] xformOpOrder = ["xformOp:translate"]
              TRIANGLE
            }
          }
          def Mesh "body" { TRIANGLE }
          def Mesh "never" { token visibility.timeSamples = { 0: "invisible", 5: "invisible" } ; TRIANGLE }
        }""",
    )
    assert len(mesh.part_names) == 2
    assert np.ptp(mesh.vertices_at(0.0), axis=0).tolist() == [1, 1, 0] and _firsts(mesh) == [[0, 0, 0]] * 2
    assert _firsts(mesh, 0.6) == [[9, 9, 9], [0, 0, 0]]


def test_native_instances_are_drawn_without_conversion(tmp_path):
    mesh = _load(
        tmp_path,
        """class "Wing" { def Mesh "skin" { TRIANGLE } }
        def Xform "Root" {
          def Xform "left" (instanceable = true; references = </Wing>) {
            double3 xformOp:translate = (0, 7, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
          }
          def Xform "right" (instanceable = true; references = </Wing>) { }
        }""",
    )
    assert mesh.part_names == ("/Root/left/skin", "/Root/right/skin") and _firsts(mesh) == [[0, 7, 0], [0, 0, 0]]


def test_pivots_reset_stacks_and_mirrors(tmp_path):
    """A quarter turn about a pivot; a prim that leaves its parents; a mirrored one, whose faces are turned."""
    mesh = _load(
        tmp_path,
        """def Xform "Root" {
          double3 xformOp:translate = (50, 0, 0)
          uniform token[] xformOpOrder = ["xformOp:translate"]
          def Mesh "hinged" {
            double3 xformOp:translate:pivot = (1, 0, 0)
            double xformOp:rotateZ = 90
            uniform token[] xformOpOrder = [
              "xformOp:translate:pivot", "xformOp:rotateZ", "!invert!xformOp:translate:pivot"]
            TRIANGLE
          }
          def Mesh "loose" {
            double3 xformOp:translate = (0, 0, 3)
            uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]
            TRIANGLE
          }
          def Mesh "mirrored" {
            double3 xformOp:scale = (-1, 1, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"]
            TRIANGLE
          }
        }""",
    )
    assert _firsts(mesh) == [[51, -1, 0], [0, 0, 3], [50, 0, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2], [3, 4, 5], [8, 7, 6]]


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("int[] protoIndices = [0, 4]; rel prototypes = </Root/one>", "/Root: protoIndices names 4 of 1 prototypes"),
        ("int[] protoIndices = [0]; rel prototypes = </Root/two>", "/Root: its prototype /Root/two is not there"),
        ("int[] protoIndices = [0, 0, 0]; rel prototypes = </Root/one>", "are not as many as its 3 protoIndices"),
        ("int[] protoIndices = [0, 0]; rel prototypes = </Root>", "instancers lie within each other without end"),
        ("int[] protoIndices.timeSamples = { 0: [0], 1: [0, 0] }; rel prototypes = </Root/one>", "protoIndices change"),
    ],
)
def test_instancers_that_contradict_themselves_are_named(tmp_path, body, message):
    positions = "point3f[] positions = [(0, 0, 0), (1, 0, 0)]"
    text = f'def PointInstancer "Root" {{ {positions}; {body}; def Mesh "one" {{ TRIANGLE }} }} '
    with pytest.raises(UserError, match=message) as caught:
        _load(tmp_path, text)
    assert str(tmp_path / "model.usda") in caught.value.problem


def test_too_many_copies_are_refused_before_they_are_made(tmp_path):
    indices = "int[] protoIndices = [" + "0, " * 70_000 + "0]; rel prototypes = </Root/one>; "
    text = f'def PointInstancer "Root" {{ {indices}def Mesh "one" {{ TRIANGLE }} }} '
    with pytest.raises(UserError, match="has 70001 copies, more than 65535"):
        _load(tmp_path, text)


def test_surfaces_that_are_not_read_are_named(tmp_path):
    with pytest.raises(UserError, match="/Root/sheet: is a NurbsPatch, which is not read; convert it to a mesh"):
        _load(tmp_path, 'def Xform "Root" { def NurbsPatch "sheet" { } }')
