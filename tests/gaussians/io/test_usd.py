"""Gaussians over time as USD: valid files, every variant of other writers; every error names file and remedy."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdValidation, UsdVol
from support.splat_scenes import assert_same, make_gaussians

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.gaussians.io.usd import write_usd
from aerojax.gaussians.io.usd_reading import read_placed_usd, read_usd
from aerojax.gaussians.rotate import covariance


def unit(gaussians: Gaussians) -> Gaussians:
    q = gaussians.quaternion
    return dataclasses.replace(gaussians, quaternion=q / jnp.linalg.norm(q, axis=-1, keepdims=True))


@pytest.mark.parametrize("frames", [1, 3])
def test_usd_round_trip_is_valid_and_time_sampled(tmp_path, frames):
    """Numbers of Gaussians may differ between frames; every validator that ships with OpenUSD is content."""
    sequence = [make_gaussians(i, 5 + i, 9, np.float32) for i in range(frames)]
    path = tmp_path / "a.usdc"
    write_usd(path, sequence, frames_per_second=25.0)
    for gaussians, again in zip(sequence, read_usd(path), strict=True):
        assert_same(again, unit(gaussians), 1e-6)
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    if frames > 1:
        assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (0, frames - 1, 25)
    first = stage.GetDefaultPrim().GetAttribute("orientations").Get(0 if frames > 1 else Usd.TimeCode.Default())[0]
    np.testing.assert_allclose([first.GetReal(), *first.GetImaginary()], unit(sequence[0]).quaternion[0], atol=1e-6)
    registry = UsdValidation.ValidationRegistry()
    validators = [registry.GetOrLoadValidatorByName(m.name) for m in registry.GetAllValidatorMetadata()]
    assert len(validators) >= 20
    assert [e.GetMessage() for e in UsdValidation.ValidationContext(validators).Validate(stage)] == []


def test_usd_mistakes_are_named(tmp_path):
    with pytest.raises(UserError, match="no such file"):
        read_usd(tmp_path / "absent.usda")
    (tmp_path / "a.usda").write_text("no usd")
    with pytest.raises(UserError, match="not a readable USD"):
        read_usd(tmp_path / "a.usda")
    Usd.Stage.CreateInMemory().Export(str(tmp_path / "b.usda"))
    with pytest.raises(UserError, match="no ParticleField3DGaussianSplat prim"):
        read_usd(tmp_path / "b.usda")
    write_usd(tmp_path / "c.usda", [make_gaussians(6, 3, 1, np.float32)])
    stage = Usd.Stage.Open(str(tmp_path / "c.usda"))
    stage.GetDefaultPrim().GetAttribute("opacities").Set([0.5])
    stage.GetRootLayer().Save()
    with pytest.raises(UserError, match="opacities has 1 entries"):
        read_usd(tmp_path / "c.usda")


def test_what_cannot_be_written_is_refused(tmp_path):
    gaussians = make_gaussians(4, 2, 1, np.float32)
    with jax.debug_nans(False):
        bad = dataclasses.replace(gaussians, scale=jnp.asarray(np.array([[1, 1, np.nan], [1, 1, 1]], np.float32)))
    batched = jax.tree.map(lambda x: x[None], gaussians)
    for broken, message in ((bad, "frame 0: non-finite"), (batched, "batch of shape")):
        with pytest.raises(UserError, match=message):
            write_usd(tmp_path / "a.usda", [broken])
    with pytest.raises(UserError, match="share one colour degree"):
        write_usd(tmp_path / "b.usda", [gaussians, make_gaussians(5, 2, 4, np.float32)])
    with pytest.raises(UserError, match="cannot be written"):
        write_usd(tmp_path / "b.txt", [gaussians])


HALF = """#usda 1.0
def ParticleField3DGaussianSplat "G"
{
    half[] opacitiesh = [0.5, 0.25]
    quath[] orientationsh = [(1, 0, 0, 0), (0, 0, 0, 1)]
    point3h[] positionsh = [(0.5, 0.25, 2), (-1, 0, 0)]
    half3[] radiance:sphericalHarmonicsCoefficientsh = [(1, 2, 3), (4, 5, 6)]
    uniform int radiance:sphericalHarmonicsDegree = 0
    half3[] scalesh = [(1, 2, 4), (0.5, 0.5, 0.25)]
}
"""


def stage_of(tmp_path, text: str):
    (tmp_path / "a.usda").write_text(text)
    return tmp_path / "a.usda"


def test_half_precision_is_read(tmp_path):
    (found,) = read_usd(stage_of(tmp_path, HALF))
    np.testing.assert_array_equal(found.mean, [[0.5, 0.25, 2], [-1, 0, 0]])
    np.testing.assert_array_equal(found.quaternion, [[1, 0, 0, 0], [0, 0, 0, 1]])
    np.testing.assert_array_equal(found.scale, [[1, 2, 4], [0.5, 0.5, 0.25]])
    np.testing.assert_array_equal(found.opacity, [0.5, 0.25])
    np.testing.assert_array_equal(found.sh[:, 0], [[1, 2, 3], [4, 5, 6]])


def test_single_precision_is_preferred_where_both_are_there(tmp_path):
    both = HALF.replace("    half[]", "    float[] opacities = [0.75, 0.125]\n    half[]")
    np.testing.assert_array_equal(read_usd(stage_of(tmp_path, both))[0].opacity, [0.75, 0.125])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("half[] opacitiesh = [0.5, 0.25]", "", "prim /G: neither opacities nor opacitiesh has a value"),
        ("[0.5, 0.25]", "[0.5]", "prim /G: opacities has 1 entries; 2 positions .* need 2"),
        ("[0.5, 0.25]", "[0.5, inf]", "opacities holds numbers that are not finite"),
        ("[0.5, 0.25]", "[0.5, -3]", "opacities must lie in 0..1"),
        ("(1, 2, 4)", "(1, -2, 4)", "scales must not be negative"),
        ("Degree = 0", "Degree = 1", "radiance:spherical.* has 2 entries; .*degree 1 need 8"),
        ("Degree = 0", "Degree = 4", "Degree is 4; 0, 1, 2 and 3"),
        ("Degree = 0", "Degree = -1", "Degree is -1"),
        (
            "point3h[] positionsh",
            "half2[] positions = [(0, 0), (1, 1)]\n    half3[] other",
            "positions has entries of another type",
        ),
        ('"G"\n', '"G" (references = @none.usda@)\n', r"cannot be composed: .*none\.usda"),
        ("def Part", 'def ParticleField3DGaussianSplat "H" {}\ndef Part', "2 Particle.* prims: /H, /G; say which"),
    ],
)
def test_odd_prims_are_named(tmp_path, old, new, message):
    assert old in HALF
    with pytest.raises(UserError, match=rf"a\.usda: .*{message}"):
        read_usd(stage_of(tmp_path, HALF.replace(old, new)))


def test_a_prim_is_chosen_by_name(tmp_path):
    two = HALF + HALF.removeprefix("#usda 1.0").replace('"G"', '"H"').replace("(0.5, 0.25, 2)", "(7, 7, 7)")
    assert float(read_usd(stage_of(tmp_path, two), prim="/H")[0].mean[0, 0]) == 7
    with pytest.raises(UserError, match="prim /K; has /G, /H"):
        read_usd(tmp_path / "a.usda", prim="/K")


def test_the_prim_stands_where_the_stage_puts_it(tmp_path):
    """Y up in centimetres, moved by (100, 200, 300) and turned a quarter about y above: by hand."""
    head = (
        '(\n  upAxis = "Y"\n  metersPerUnit = 0.01\n)\ndef Xform "W" {\n  double3 xformOp:translate = (100, 200, 300)\n'
    )
    head += '  float xformOp:rotateY = 90\n  uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]\n'
    (found,) = read_usd(stage_of(tmp_path, HALF.replace("#usda 1.0\n", "#usda 1.0\n" + head) + "}\n"))
    # x y z → (z, y, -x) by the quarter turn → + translation → cm → (x, -z, y).
    np.testing.assert_allclose(found.mean, [[1.02, -2.995, 2.0025], [1.0, -3.01, 2.0]], atol=1e-6)
    np.testing.assert_allclose(found.scale, np.array([[1, 2, 4], [0.5, 0.5, 0.25]]) / 100, rtol=1e-5)
    axis = np.asarray(covariance(found))[0] * 1e4
    np.testing.assert_allclose(axis, np.diag([16, 1, 4]), atol=1e-3)


def test_far_prims_keep_their_millimetres(tmp_path):
    gaussians = unit(make_gaussians(3, 4, 4, np.float32))
    origin = np.array([4.5e5, 5.6e6 + 1e-3, 312.25])
    write_usd(tmp_path / "a.usdc", [gaussians, gaussians], origin=origin)
    frames, place = read_placed_usd(tmp_path / "a.usdc")
    for again in frames:
        world = place[None] + np.asarray(again.mean, np.float64)
        np.testing.assert_allclose(world, origin[None] + np.asarray(gaussians.mean, np.float64), atol=1e-4, rtol=0)
    stage = Usd.Stage.Open(str(tmp_path / "a.usdc"))
    world_from_prim = UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetDefaultPrim())
    assert world_from_prim.ExtractTranslation() == Gf.Vec3d(*origin.tolist())
    with pytest.raises(UserError, match=r"a\.usdc: its Gaussians lie about .*read_placed_usd"):
        read_usd(tmp_path / "a.usdc")
    with pytest.raises(UserError, match="origin has non-finite"):
        write_usd(tmp_path / "b.usdc", [gaussians], origin=np.array([np.nan, 0, 0]))


@pytest.mark.parametrize(
    ("scale", "message"), [((1, 1, -1), "mirrors, flattens"), ((1, 1, 0), "mirrors, flattens"), ((1, 1, 2), "shears")]
)
def test_transforms_that_gaussians_cannot_follow_are_refused(tmp_path, scale, message):
    write_usd(tmp_path / "a.usda", [make_gaussians(6, 3, 1, np.float32)])
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    UsdVol.ParticleField3DGaussianSplat(stage.GetDefaultPrim()).AddScaleOp().Set(Gf.Vec3f(*scale))
    stage.GetRootLayer().Save()
    with pytest.raises(UserError, match=rf"prim /Gaussians: its transform {message}"):
        read_usd(tmp_path / "a.usda")


def test_files_of_reported_bugs(shared):
    """Half precision is read, an empty prim is named."""
    folder = shared / "bugs" / "usdsplat"
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent")
    (found,) = read_usd(folder / "half.usda")
    np.testing.assert_allclose(found.mean[1], [0.920898, 0.0783691, 0.157593], rtol=1e-3)
    np.testing.assert_allclose(found.scale, np.full((4, 3), 0.1), rtol=1e-3)
    np.testing.assert_allclose(found.sh[:, 0], [[0.1, 0.2, 0.3]] * 4, rtol=1e-3)
    np.testing.assert_allclose(found.opacity, [0.5] * 4)
    with pytest.raises(UserError, match=r"empty\.usda: prim /G: neither positions nor positionsh has a value"):
        read_usd(folder / "empty.usda")


def test_damage_that_crashes_usd_is_refused(tmp_path):
    """The first byte after the head of a crate file; USD 26.11 reads where nothing is and ends by a signal."""
    path = tmp_path / "a.usdc"
    write_usd(path, [make_gaussians(0, 5, 9, np.float32)])
    content = bytearray(path.read_bytes())
    content[88] ^= 0x81
    path.write_bytes(content)
    plain = f"from pxr import Usd; Usd.Stage.Open({str(path)!r})"
    if subprocess.run([sys.executable, "-c", plain], stderr=subprocess.DEVNULL).returncode >= 0:
        pytest.skip("this USD library is not ended by it")
    with pytest.raises(UserError, match=r"a\.usdc: is damaged: reading it crashes the USD library") as refused:
        read_usd(path)
    assert refused.value.code == "unreadable"
