"""Gaussians as PLY: standard and compressed, every variant of other writers; every error names file and remedy."""

from __future__ import annotations

import dataclasses
import shutil
import subprocess
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.splat_scenes import BACKGROUND, assert_same, drawing, make_camera, make_gaussians

from aerojax.core.errors import UserError
from aerojax.core.types import SH_C0, Gaussians
from aerojax.gaussians.io.ply import property_names, read_placed_ply, read_ply, write_ply
from aerojax.gaussians.rotate import covariance

STORED = Path(__file__).resolve().parents[2] / "parity" / "data" / "splat_ply"


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


def written(tmp_path, damage, *, coefficients: int = 1, count: int = 2) -> Path:
    """A standard file whose bytes are changed."""
    write_ply(tmp_path / "a.ply", make_gaussians(3, count, coefficients, np.float32))
    (tmp_path / "b.ply").write_bytes(damage((tmp_path / "a.ply").read_bytes()))
    return tmp_path / "b.ply"


def with_number(name: str, value: float):
    """The first Gaussian's number is another."""
    place = property_names(1).index(name) * 4

    def change(content: bytes) -> bytes:
        start = content.index(b"end_header\n") + len(b"end_header\n") + place
        return content[:start] + np.float32(value).tobytes() + content[start + 4 :]

    return change


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda b: b"solid" + b, "not a PLY file"),
        (lambda b: b.replace(b"end_header", b"end_of_it_"), "not a PLY file"),
        (lambda b: b.replace(b"little", b"middle"), "line 2 of the header.*not understood"),
        (lambda b: b.replace(b"format binary_little_endian 1.0\n", b""), "no line 'format"),
        (lambda b: b.replace(b"comment", b"remark!"), "line 3 .*not understood"),
        (lambda b: b[:-4], "needs 136 bytes, 132 are left"),
        (lambda b: b + b"four", "4 bytes are left behind the last element"),
        (lambda b: b.replace(b"vertex 2", b"vertex two"), "'two' is no number of rows"),
        (lambda b: b.replace(b"vertex 2", b"vertex -2"), "'-2' is no number of rows"),
        (lambda b: b.replace(b"vertex 2", b"vertex 999999999999999999"), "needs 67999999999999999932 bytes"),
        (lambda b: b.replace(b"property float rot_2", b"property float spin2"), "missing: rot_2"),
        (lambda b: b.replace(b"property float ny", b"property float nx"), "line 9 .*property is declared twice"),
        (lambda b: b.replace(b"element vertex", b"element vertex 0\nelement vertex"), "element is declared twice"),
        (lambda b: b.replace(b"element vertex 2\n", b""), "line 4 .*not understood here"),
        (lambda b: b.replace(b"property float nx", b"property quad nx"), "known types are char"),
        (lambda b: b.replace(b"element vertex", b"element points"), "no element 'vertex'"),
        (lambda b: b.replace(b"property float nx", b"property float f_rest_0"), "1 f_rest properties"),
        (lambda b: b.replace(b"float nx", b"float f_rest_0").replace(b"float ny", b"float f_rest_1"), "2 f_rest"),
        (with_number("x", np.nan), "x, y, z of 1 of 2 Gaussians are not finite"),
        (with_number("z", np.inf), "x, y, z of 1 of 2"),
        (with_number("scale_1", 1000.0), r"scale_0\.\.2 of 1 of 2"),
        (with_number("opacity", np.nan), "opacity of 1 of 2"),
        (with_number("rot_3", np.nan), r"rot_0\.\.3 of 1 of 2"),
        (with_number("f_dc_1", -np.inf), "f_dc, f_rest of 1 of 2"),
        (lambda b: b.replace(b"comment", b"comment offset 1 2\ncomment"), "'comment offset' must .*three numbers"),
        (lambda b: b.replace(b"comment", b"comment offset 1 2 nan\ncomment"), "'comment offset' must"),
        (lambda b: b.replace(b"comment", b"comment offset 1e7 2 3\ncomment"), "read it with read_placed_ply"),
    ],
)
def test_damaged_ply_is_named(tmp_path, damage, message):
    with pytest.raises(UserError, match=rf"b\.ply.*{message}"):
        read_ply(written(tmp_path, damage))


def test_infinite_logits_and_logarithms_mean_what_they_say(tmp_path):
    """Opacity 1 is logit ∞, scale 0 is log -∞; both are exact."""
    assert float(read_ply(written(tmp_path, with_number("opacity", np.inf))).opacity[0]) == 1.0
    assert float(read_ply(written(tmp_path, with_number("opacity", -np.inf))).opacity[0]) < 1e-30
    assert float(read_ply(written(tmp_path, with_number("scale_2", -np.inf))).scale[0, 2]) == 0.0


def test_vertices_with_lists_are_refused(tmp_path):
    lines = ["ply", "format ascii 1.0", "element vertex 1", "property list uchar int nx", "end_header", "1 5"]
    (tmp_path / "a.ply").write_text("\n".join(lines))
    with pytest.raises(UserError, match=r"a\.ply: vertex properties nx are lists"):
        read_ply(tmp_path / "a.ply")


@pytest.mark.parametrize("coefficients", [1, 4])
def test_ascii_big_endian_and_line_ends_of_every_system(tmp_path, coefficients):
    """The same numbers in another form are the same Gaussians."""
    write_ply(tmp_path / "a.ply", make_gaussians(3, 4, coefficients, np.float32))
    header, body = (tmp_path / "a.ply").read_bytes().split(b"end_header\n")
    header += b"end_header\n"
    numbers = np.frombuffer(body, "<f4").reshape(4, -1)
    text = "\n".join(" ".join(f"{x:.9g}" for x in row) for row in numbers)
    forms = {
        "big.ply": header.replace(b"little", b"big") + numbers.astype(">f4").tobytes(),
        "ascii.ply": header.replace(b"binary_little_endian", b"ascii") + text.encode() + b"\n",
        "windows.ply": header.replace(b"\n", b"\r\n") + body,
        "old_mac.ply": header.replace(b"\n", b"\r") + body,
    }
    plain = read_ply(tmp_path / "a.ply")
    for name, content in forms.items():
        (tmp_path / name).write_bytes(content)
        assert_same(read_ply(tmp_path / name), plain, 1e-6)


def test_lists_of_other_elements_are_passed_over(tmp_path):
    """Faces before and behind the vertices, with entries and without."""
    lists = b"property list uchar int vertex_indices\n"

    def with_faces(content: bytes) -> bytes:
        header, body = content.split(b"end_header\n")
        header = header.replace(b"element vertex", b"element face 2\n" + lists + b"element vertex")
        header += b"element strip 1\nproperty list short float s\nproperty uchar c\nelement edge 0\n" + lists
        faces = b"\x03" + bytes(12) + b"\x00"
        return header + b"end_header\n" + faces + body + b"\x01\x00" + bytes(4) + b"\x07"

    assert_same(read_ply(written(tmp_path, with_faces)), read_ply(tmp_path / "a.ply"), 0)


def test_the_smoothing_filter_is_folded_in(tmp_path):
    """By hand: s = (3, 4, 0) and w = 4 give s' = (5, 4√2, 4); a scale of 0 leaves no peak."""
    sh = jnp.zeros((2, 1, 3))
    turned = jnp.array([[1.0, 0, 0, 0]] * 2)
    scale = jnp.array([[3.0, 4, 1], [3, 4, 12]])
    write_ply(tmp_path / "a.ply", Gaussians(jnp.zeros((2, 3)), turned, scale, jnp.array([0.5, 0.5]), sh))
    header, body = (tmp_path / "a.ply").read_bytes().split(b"end_header\n")
    rows = np.concatenate([np.frombuffer(body, "<f4").reshape(2, -1), [[0.0], [4.0]]], axis=1)
    content = header + b"property float filter_3D\nend_header\n" + rows.astype("<f4").tobytes()
    (tmp_path / "b.ply").write_bytes(content)
    smoothed = read_ply(tmp_path / "b.ply")
    np.testing.assert_allclose(smoothed.scale, [[3, 4, 1], [5, 32**0.5, 160**0.5]], rtol=1e-6)
    np.testing.assert_allclose(smoothed.opacity, [0.5, 0.5 * 3 / 5 * 4 / 32**0.5 * 12 / 160**0.5], rtol=1e-6)
    (tmp_path / "b.ply").write_bytes(content[:-4] + np.float32(-1).tobytes())
    with pytest.raises(UserError, match=r"b\.ply: filter_3D must be finite and not negative"):
        read_ply(tmp_path / "b.ply")


def test_far_gaussians_keep_their_millimetres(tmp_path):
    """A UTM northing: the offset is float64 in the header, the positions about it are the same to the bit."""
    gaussians = unit(make_gaussians(3, 4, 4, np.float32))
    origin = np.array([4.5e5 + 1 / 3, 5.6e6 + 1e-3, 312.25])
    write_ply(tmp_path / "a.ply", gaussians, origin=origin)
    again, place = read_placed_ply(tmp_path / "a.ply")
    np.testing.assert_array_equal(again.mean, gaussians.mean)
    np.testing.assert_array_equal(place, origin)
    write_ply(tmp_path / "b.ply", gaussians, origin=np.zeros(3))
    assert b"offset" not in (tmp_path / "b.ply").read_bytes()
    assert_same(read_ply(tmp_path / "b.ply"), gaussians, 1e-6)
    with pytest.raises(UserError, match="origin has 1 non-finite"):
        write_ply(tmp_path / "c.ply", gaussians, origin=np.array([0, np.inf, 0]))


def test_far_positions_in_double_precision_are_split(tmp_path):
    """World = origin + mean to 1e-6 m; `read_ply` would round to half a metre and says so."""
    gaussians = unit(make_gaussians(3, 4, 1, np.float32))
    world = np.asarray(gaussians.mean, np.float64) + np.array([[4.5e5, 5.6e6, 10.0]])
    names = property_names(1)
    dtype = np.dtype([(n, "<f8" if n in "xyz" else "<f4") for n in names])
    write_ply(tmp_path / "a.ply", gaussians)
    header, body = (tmp_path / "a.ply").read_bytes().split(b"end_header\n")
    rows = np.zeros(4, dtype)
    for index, name in enumerate(names):
        rows[name] = world[:, index] if index < 3 else np.frombuffer(body, "<f4").reshape(4, -1)[:, index]
    for name in (b"x", b"y", b"z"):
        header = header.replace(b"property float " + name + b"\n", b"property double " + name + b"\n")
    (tmp_path / "b.ply").write_bytes(header + b"end_header\n" + rows.tobytes())
    again, origin = read_placed_ply(tmp_path / "b.ply")
    np.testing.assert_allclose(origin[None] + np.asarray(again.mean, np.float64), world, atol=1e-6, rtol=0)
    with pytest.raises(UserError, match=r"b\.ply: its Gaussians lie about \[450000\.0, 5600000\.0, .*read_placed_ply"):
        read_ply(tmp_path / "b.ply")


BUGS = ("ascii", "bigendian", "comment_endheader", "faces0", "mip_filter3D")


@pytest.mark.parametrize("name", BUGS)
def test_files_of_reported_bugs_are_read(shared, name):
    """Five Gaussians each; the numbers are those of an independent reading of the bytes."""
    path = shared / "bugs" / "ply" / f"{name}.ply"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    content = path.read_bytes()
    body = content[content.index(b"\nend_header\n") + len(b"\nend_header\n") :]
    names = [w.split()[2].decode() for w in content.split(b"\nend_header\n")[0].split(b"\n") if b"property float " in w]
    rows = np.array(body.split(), float) if name == "ascii" else np.frombuffer(body, ">f4" if "big" in name else "<f4")
    column = dict(zip(names, rows.reshape(5, -1).T.astype(np.float64), strict=True))
    scale = np.exp([column[f"scale_{i}"] for i in range(3)]).T
    width = column.get("filter_3D", np.zeros(5))[:, None]
    opacity = 1 / (1 + np.exp(-column["opacity"])) * np.prod(scale / np.sqrt(scale**2 + width**2), axis=1)
    found = read_ply(path)
    np.testing.assert_allclose(found.mean, np.stack([column[a] for a in "xyz"], -1), rtol=1e-6)
    np.testing.assert_allclose(found.scale, np.sqrt(scale**2 + width**2), rtol=1e-5)
    np.testing.assert_allclose(found.opacity, opacity, rtol=1e-5)
    np.testing.assert_allclose(found.sh[:, 15, 1], column["f_rest_29"], rtol=1e-6)


def test_a_property_of_reported_bugs_that_is_there_twice_is_refused(shared):
    path = shared / "bugs" / "ply" / "dupprop.ply"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    with pytest.raises(UserError, match=r"dupprop\.ply: line \d+ of the header.*declared twice"):
        read_ply(path)


def test_damaged_compressed_ply_is_named(tmp_path):
    content = (STORED / "supersplat.compressed.ply").read_bytes()
    changes = [
        ((b"packed_scale", b"packed_world"), "lacks packed_scale"),
        ((b"property uint packed_color", b"property float packed_color"), "lacks packed_color as uint"),
        ((b"min_scale_x", b"min_shape_x"), "lacks min_scale_x"),
        ((b"element vertex 6", b"element vertex 0"), "0 vertices need 0 chunks|bytes are left"),
    ]
    for (old, new), message in changes:
        assert old in content
        (tmp_path / "a.ply").write_bytes(content.replace(old, new))
        with pytest.raises(UserError, match=rf"a\.ply.*({message})"):
            read_ply(tmp_path / "a.ply")


def test_what_cannot_be_written_is_refused(tmp_path):
    gaussians = make_gaussians(4, 2, 1, np.float32)
    with jax.debug_nans(False):
        bad = dataclasses.replace(gaussians, scale=jnp.asarray(np.array([[1, 1, np.nan], [1, 1, 1]], np.float32)))
    batched = jax.tree.map(lambda x: x[None], gaussians)
    for broken, message in ((bad, "scale has 1 non-finite"), (batched, "batch of shape")):
        with pytest.raises(UserError, match=message):
            write_ply(tmp_path / "a.ply", broken)
    with pytest.raises(UserError, match="no such file"):
        read_ply(tmp_path / "absent.ply")


@pytest.mark.skipif(shutil.which("splat-transform") is None, reason="needs @playcanvas/splat-transform on PATH")
def test_an_independent_tool_converts_there_and_back(tmp_path):
    write_ply(tmp_path / "a.ply", make_gaussians(7, 50, 16, np.float32))
    for source, target in (("a.ply", "b.spz"), ("b.spz", "c.ply"), ("a.ply", "d.html"), ("a.ply", "e.compressed.ply")):
        command = ["splat-transform", "-q", "-w", "--gpu", "cpu", str(tmp_path / source), str(tmp_path / target)]
        subprocess.run(command, check=True, capture_output=True)
    for name in ("c.ply", "e.compressed.ply"):
        assert read_ply(tmp_path / name).mean.shape == (50, 3)
    assert (tmp_path / "d.html").stat().st_size > 100_000
