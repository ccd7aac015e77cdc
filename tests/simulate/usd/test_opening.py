"""Stages that name what is missing, units, and time without a range."""

from __future__ import annotations

import pytest
from support.model_imports import import_model
from support.usd_text import METRIC, write_usda

from aerojax.core.errors import UserError
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

MESH = 'def Mesh "body" { TRIANGLE } '
SAMPLES = "double3 xformOp:translate.timeSamples = { 6: (0, 0, 0), 30: (0, 0, 8) } "
MOVING = f'def Xform "wing" {{ {SAMPLES}; uniform token[] xformOpOrder = ["xformOp:translate"]; {MESH} }} '


@pytest.mark.parametrize(
    ("body", "fields", "message"),
    [
        (MESH + 'def "wing" (references = @./none.usda@) { }', "", "none.usda@ for reference introduced by"),
        (MESH + 'def "wing" (payload = @./none.usda@) { }', "", "none.usda@ for payload introduced by"),
        (MESH, "subLayers = [@./none.usda@]", "Could not load sublayer"),
        (MESH + 'def "wing" (references = </none>) { }', "", "/none"),
        (MESH, "metersPerUnit = 0", "metersPerUnit is 0.0; set it to the metres of one unit"),
        (MESH, 'upAxis = "X"', "upAxis is X; USD has Y and Z"),
        (MESH, "timeCodesPerSecond = 0", "timeCodesPerSecond is 0"),
        (MESH, "startTimeCode = 0; endTimeCode = inf", "startTimeCode is 0.0, endTimeCode inf"),
    ],
)
def test_what_is_missing_is_named(tmp_path, body, fields, message):
    path = write_usda(tmp_path / "model.usda", body, fields or METRIC)
    for read in (load_animated_mesh, lambda p: import_model(p.parent, p.name, "forward: +X")):
        with pytest.raises(UserError) as caught:
            read(path)
        assert str(path) in caught.value.problem and message in str(caught.value)


@pytest.mark.parametrize("imported", [False, True])
@pytest.mark.parametrize(
    ("rate", "seconds"), [("", 1.0), ("timeCodesPerSecond = 48", 0.5), ("framesPerSecond = 12", 2.0)]
)
def test_samples_without_a_range_are_played_whole(tmp_path, imported, rate, seconds):
    """From the first sample to the last, at the stage's rate: time codes, else frames, else 24 a second."""
    path = write_usda(tmp_path / "model.usda", MESH + MOVING, METRIC + rate)
    mesh = import_model(tmp_path, path.name, "scale: 1.0, forward: +X") if imported else load_animated_mesh(path)
    assert mesh.cycle_seconds == pytest.approx(seconds)
    for share in (0.0, 0.25, 0.75):
        vertices = mesh.vertices_at(share * seconds)
        assert vertices[3, 2] - vertices[0, 2] == pytest.approx(8 * share, abs=1e-5)


def test_half_a_range_is_completed_by_the_samples(tmp_path):
    mesh = load_animated_mesh(write_usda(tmp_path / "model.usda", MOVING, METRIC + "startTimeCode = 18"))
    assert mesh.cycle_seconds == pytest.approx(0.5) and mesh.vertices_at(0.0)[0, 2] == pytest.approx(4.0)
