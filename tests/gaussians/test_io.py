"""Gaussians on disk: standard PLY, SuperSplat's compressed PLY, USD over time; every error names file and remedy."""

from __future__ import annotations

import dataclasses
import shutil
import subprocess
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdValidation
from support.splat_scenes import BACKGROUND, assert_same, drawing, make_camera, make_gaussians

from aerojax.core.errors import UserError
from aerojax.core.types import SH_C0, Gaussians
from aerojax.gaussians.io.ply import property_names, read_ply, write_ply
from aerojax.gaussians.io.usd import read_usd, write_usd
from aerojax.gaussians.rotate import covariance

STORED = Path(__file__).resolve().parents[1] / "parity" / "data" / "splat_ply"


def unit(gaussians: Gaussians) -> Gaussians:
    q = gaussians.quaternion
    return dataclasses.replace(gaussians, quaternion=q / jnp.linalg.norm(q, axis=-1, keepdims=True))


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
def test_ply_round_trip(tmp_path, coefficients):
    gaussians = make_gaussians(0, 7, coefficients, np.float32)
    write_ply(tmp_path / "a.ply", gaussians)
    assert_same(read_ply(tmp_path / "a.ply"), unit(gaussians), 1e-6)


def test_ply_bytes_are_the_standard_layout(tmp_path):
    """Hand-computed: log 0.1, logit 0.75 = log 3, DC of pure red; f_rest holds all of red, then green, then blue."""
    sh = np.zeros((1, 4, 3), np.float32)
    sh[0, 0] = (0.5 / SH_C0, -0.5 / SH_C0, -0.5 / SH_C0)
    sh[0, 1:] = np.arange(9).reshape(3, 3)
    rows = ([[1.0, 2, 3]], [[2.0, 0, 0, 0]], [[0.1, 1, 0]], [0.75])
    write_ply(tmp_path / "a.ply", Gaussians(*(jnp.array(x) for x in rows), jnp.asarray(sh)))
    header, body = (tmp_path / "a.ply").read_bytes().split(b"end_header\n")
    names = [line.split()[-1].decode() for line in header.splitlines() if line.startswith(b"property float ")]
    assert names == property_names(4) and b"element vertex 1\n" in header
    values = dict(zip(names, np.frombuffer(body, "<f4"), strict=True))
    expected = {"x": 1, "y": 2, "z": 3, "nx": 0, "opacity": np.log(3), "scale_0": np.log(0.1), "scale_1": 0, "rot_0": 1}
    expected |= {"f_dc_0": 0.5 / 0.28209479, "f_dc_1": -0.5 / 0.28209479}
    expected |= {f"f_rest_{i}": v for i, v in enumerate((0, 3, 6, 1, 4, 7, 2, 5, 8))}
    for name, value in expected.items():
        np.testing.assert_allclose(values[name], value, rtol=1e-6, err_msg=name)
    assert np.isfinite(values["scale_2"])


def test_rendering_of_an_exported_ply_exceeds_60_decibels(tmp_path):
    gaussians, camera = make_gaussians(1, 60, 16, np.float32), make_camera(dtype=np.float32)
    gaussians = dataclasses.replace(gaussians, opacity=gaussians.opacity.at[0].set(1.0))
    write_ply(tmp_path / "a.ply", gaussians)
    draw = drawing()
    background = jnp.array(BACKGROUND)
    direct = draw(gaussians, camera, background=background).colour
    again = draw(read_ply(tmp_path / "a.ply"), camera, background=background).colour
    assert float(-10 * jnp.log10(jnp.mean((direct - again) ** 2) + 1e-20)) > 60


def test_properties_in_any_order_and_type(tmp_path):
    gaussians = make_gaussians(2, 3, 1, np.float32)
    write_ply(tmp_path / "a.ply", gaussians)
    body = (tmp_path / "a.ply").read_bytes().split(b"end_header\n")[1]
    names = property_names(1)
    columns = np.frombuffer(body, "<f4").reshape(3, -1)
    order = [n for n in reversed(names) if n not in ("nx", "ny", "nz")]
    lines = ["ply", "format binary_little_endian 1.0", "element camera 2", "property uchar flag", "element vertex 3"]
    lines += [f"property double {n}" for n in order] + ["property int extra", "end_header\n"]
    dtype = np.dtype([(n, "<f8") for n in order] + [("extra", "<i4")])
    rows = np.zeros(3, dtype)
    for name in order:
        rows[name] = columns[:, names.index(name)]
    (tmp_path / "b.ply").write_bytes("\n".join(lines).encode() + b"\x01\x02" + rows.tobytes())
    assert_same(read_ply(tmp_path / "b.ply"), unit(gaussians), 1e-6)


def test_compressed_ply_of_an_independent_writer():
    """Positions to 11 bits, rotation and scale to 10-11, colour and opacity to 8 of their ranges."""
    plain, packed = read_ply(STORED / "standard.ply"), read_ply(STORED / "supersplat.compressed.ply")
    distance = np.linalg.norm(np.asarray(plain.mean)[:, None] - np.asarray(packed.mean)[None], axis=-1)
    order = distance.argmin(axis=1)
    assert sorted(order) == list(range(6))
    packed = jax.tree.map(lambda x: x[order], packed)
    np.testing.assert_allclose(packed.mean, plain.mean, atol=2e-3)
    np.testing.assert_allclose(packed.scale, plain.scale, rtol=2e-3)
    np.testing.assert_allclose(packed.opacity, plain.opacity, atol=3e-3)
    np.testing.assert_allclose(packed.sh, plain.sh, atol=1.7e-2)
    np.testing.assert_allclose(covariance(packed), covariance(plain), atol=1e-2 * float(covariance(plain).max()))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda b: b"solid" + b, "not a PLY file"),
        (lambda b: b.replace(b"little", b"big___"), "only 'format binary_little_endian"),
        (lambda b: b[:-4], "bytes, .* are left"),
        (lambda b: b.replace(b"property float rot_2", b"property float spin2"), "missing: rot_2"),
        (lambda b: b.replace(b"element vertex", b"element points"), "no element 'vertex'"),
        (lambda b: b.replace(b"property float nx", b"property list uchar int nx"), "'list' is not a scalar"),
        (lambda b: b.replace(b"property float nx", b"property float f_rest_0"), "1 f_rest properties"),
    ],
)
def test_damaged_ply_is_named(tmp_path, damage, message):
    write_ply(tmp_path / "a.ply", make_gaussians(3, 2, 1, np.float32))
    (tmp_path / "b.ply").write_bytes(damage((tmp_path / "a.ply").read_bytes()))
    with pytest.raises(UserError, match=rf"b\.ply.*{message}"):
        read_ply(tmp_path / "b.ply")


def test_damaged_compressed_ply_is_named(tmp_path):
    content = (STORED / "supersplat.compressed.ply").read_bytes()
    (tmp_path / "a.ply").write_bytes(content.replace(b"packed_scale", b"packed_world"))
    with pytest.raises(UserError, match="lacks packed_scale"):
        read_ply(tmp_path / "a.ply")


def test_what_cannot_be_written_is_refused(tmp_path):
    gaussians = make_gaussians(4, 2, 1, np.float32)
    with jax.debug_nans(False):
        bad = dataclasses.replace(gaussians, scale=jnp.asarray(np.array([[1, 1, np.nan], [1, 1, 1]], np.float32)))
    batched = jax.tree.map(lambda x: x[None], gaussians)
    for broken, message in ((bad, "scale has 1 non-finite"), (batched, "batch of shape")):
        with pytest.raises(UserError, match=message):
            write_ply(tmp_path / "a.ply", broken)
    for broken, message in ((bad, "frame 0: non-finite"), (batched, "batch of shape")):
        with pytest.raises(UserError, match=message):
            write_usd(tmp_path / "a.usda", [broken])
    with pytest.raises(UserError, match="share one colour degree"):
        write_usd(tmp_path / "b.usda", [gaussians, make_gaussians(5, 2, 4, np.float32)])
    with pytest.raises(UserError, match="cannot be written"):
        write_usd(tmp_path / "b.txt", [gaussians])
    with pytest.raises(UserError, match="no such file"):
        read_ply(tmp_path / "absent.ply")


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
    with pytest.raises(UserError, match="opacities has 1 numbers"):
        read_usd(tmp_path / "c.usda")


@pytest.mark.skipif(shutil.which("splat-transform") is None, reason="needs @playcanvas/splat-transform on PATH")
def test_an_independent_tool_converts_there_and_back(tmp_path):
    write_ply(tmp_path / "a.ply", make_gaussians(7, 50, 16, np.float32))
    for source, target in (("a.ply", "b.spz"), ("b.spz", "c.ply"), ("a.ply", "d.html"), ("a.ply", "e.compressed.ply")):
        command = ["splat-transform", "-q", "-w", "--gpu", "cpu", str(tmp_path / source), str(tmp_path / target)]
        subprocess.run(command, check=True, capture_output=True)
    for name in ("c.ply", "e.compressed.ply"):
        assert read_ply(tmp_path / name).mean.shape == (50, 3)
    assert (tmp_path / "d.html").stat().st_size > 100_000
