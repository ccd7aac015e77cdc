"""USD files from elsewhere are read through a copy; those that USD cannot read end no process of ours."""

from __future__ import annotations

import sys

import pytest
from pxr import Sdf, Usd, UsdGeom

from aerojax.core import usd_flatten
from aerojax.core.errors import UserError
from aerojax.core.usd_copies import is_flattening, usd_copy


def write_parts(folder):
    """A stage that takes a part from another file, twice, as instances, and says its units, axes and times."""
    part = Usd.Stage.CreateNew(str(folder / "part.usdc"))
    ball = UsdGeom.Sphere.Define(part, "/P/ball")
    ball.CreateRadiusAttr().Set(2.0, 1.0)
    ball.GetRadiusAttr().Set(4.0, 3.0)
    texture = ball.GetPrim().CreateAttribute("picture", Sdf.ValueTypeNames.Asset)
    texture.Set("./skin.png")
    part.Save()
    stage = Usd.Stage.CreateNew(str(folder / "whole.usda"))
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, 0.5)
    stage.SetTimeCodesPerSecond(12)
    stage.SetEndTimeCode(7)
    for name in ("/A", "/B"):
        prim = stage.DefinePrim(name)
        prim.GetReferences().AddReference("part.usdc", "/P", Sdf.LayerOffset(1.0))
        prim.SetInstanceable(True)
    stage.GetRootLayer().Save()
    return folder / "whole.usda"


def test_a_copy_says_what_the_file_says(tmp_path):
    path = write_parts(tmp_path)
    (tmp_path / "skin.png").write_bytes(b"x")
    with usd_copy(path) as copy:
        assert copy.broken == () and copy.path.parent != tmp_path
        stage = Usd.Stage.Open(str(copy.path))
        assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Y", 0.5)
        assert (stage.GetTimeCodesPerSecond(), stage.GetEndTimeCode()) == (12, 7)
        assert not stage.GetRootLayer().HasStartTimeCode() and not stage.GetRootLayer().externalReferences
        for name in ("/A", "/B"):
            ball = UsdGeom.Sphere(stage.GetPrimAtPath(f"{name}/ball"))
            radius = {time: ball.GetRadiusAttr().Get(time) for time in ball.GetRadiusAttr().GetTimeSamples()}
            assert radius == {1.5: 2.0, 2.5: 4.0}  # the part has 24 time codes a second, and begins 1 later
            assert ball.GetPrim().GetAttribute("picture").Get().path == str(tmp_path / "skin.png")
    assert not copy.path.exists()


def test_what_leads_nowhere_is_told(tmp_path):
    path = write_parts(tmp_path)
    (tmp_path / "part.usdc").unlink()
    with usd_copy(path) as copy:
        assert {kind for kind, _ in copy.broken} == {"ErrorInvalidAssetPath"}
        assert all("part.usdc" in words for _, words in copy.broken)


def test_words_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "a.usda"
    path.write_bytes(b'#usda 1.0\ndef Xform "W\xff\xfe" {\n    \xff = \xfe\n')
    with pytest.raises(UserError, match=r"a\.usda is not a readable USD file") as refused, usd_copy(path):
        pass
    assert refused.value.code == "unreadable"


def test_a_reader_that_crashes_is_told(tmp_path, monkeypatch):
    path, program = write_parts(tmp_path), tmp_path / "crashing.py"
    program.write_text("import os\nos.abort()\n")
    monkeypatch.setattr(usd_flatten, "__file__", str(program))
    with (
        pytest.raises(UserError, match=r"whole\.usda: .* crashes the USD library \(SIGABRT\)") as refused,
        usd_copy(path),
    ):
        pass
    assert refused.value.code == "unreadable"


def test_a_file_that_takes_too_long_is_refused(tmp_path, monkeypatch):
    path, program = write_parts(tmp_path), tmp_path / "endless.py"
    program.write_text("import resource\nresource.setrlimit(resource.RLIMIT_CPU, (1, 1))\nwhile True: pass\n")
    monkeypatch.setattr(usd_flatten, "__file__", str(program))
    with pytest.raises(UserError, match=r"whole\.usda: USD did not read it within") as refused, usd_copy(path):
        pass
    assert refused.value.code == "out-of-range"


def test_that_program_is_known():
    program = (sys.executable, "-P", "-B", usd_flatten.__file__)
    assert is_flattening((*program, "a", "b")) and not is_flattening((sys.executable, "-c", "pass"))
