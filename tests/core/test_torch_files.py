"""Files of `torch.save` read without torch: numbers by hand, every refusal, and nothing of a file ever runs."""

from __future__ import annotations

import pickle
import zipfile

import numpy as np
import pytest
from support.torch_files import Tensor, Writer, name_of, write_archive, write_stream

from aerojax.core.errors import UserError
from aerojax.core.torch_files import read_state_dict, read_torch

FORMATS = pytest.mark.parametrize("write", [write_archive, write_stream], ids=["archive", "stream"])


@FORMATS
@pytest.mark.parametrize("kind", ["f4", "f8", "f2", "i8", "i4", "u1", "b1"])
def test_arrays_of_every_type_come_back(tmp_path, write, kind):
    stored = np.arange(6).reshape(2, 3).astype(kind)
    write(tmp_path / "a.pt", {"weight": stored, "count": np.array(7)})
    found = read_state_dict(tmp_path / "a.pt")
    assert list(found) == ["weight", "count"] and found["weight"].dtype == stored.dtype
    np.testing.assert_array_equal(found["weight"], stored)
    assert found["count"].shape == () and found["count"] == 7


@FORMATS
def test_other_values_keep_their_structure(tmp_path, write):
    content = {"versions": np.ones((2, 3), np.float32), "label": 2, "name": "Möwe", "flags": (True, None), "x": [1.5]}
    write(tmp_path / "a.pt", content)
    found = read_torch(tmp_path / "a.pt")
    assert {k: v for k, v in found.items() if k != "versions"} == {k: v for k, v in content.items() if k != "versions"}
    np.testing.assert_array_equal(found["versions"], content["versions"])


def test_strides_offsets_and_parameters(tmp_path):
    numbers = np.arange(12, dtype=np.float32)
    transposed = Tensor(numbers, "FloatStorage", 0, (4, 3), (1, 4), parameter=True)
    every_other = Tensor(numbers, "FloatStorage", 1, (2, 3), (6, 2))
    empty = Tensor(numbers, "FloatStorage", 12, (0, 3), (3, 1))
    write_archive(tmp_path / "a.pt", {"t": transposed, "e": every_other, "0": empty})
    found = read_state_dict(tmp_path / "a.pt")
    np.testing.assert_array_equal(found["t"], numbers.reshape(3, 4).T)
    np.testing.assert_array_equal(found["e"], [[1, 3, 5], [7, 9, 11]])
    assert found["0"].shape == (0, 3) and not found["t"].flags.writeable


def test_bfloat16_and_the_other_byte_order(tmp_path):
    """1.0 is 0x3F80, -2.5 is 0xC020 in bfloat16."""
    write_archive(tmp_path / "a.pt", {"b": Tensor(np.array([0x3F80, 0xC020], "<u2"), "BFloat16Storage", 0, (2,), (1,))})
    np.testing.assert_array_equal(read_state_dict(tmp_path / "a.pt")["b"], np.array([1.0, -2.5], np.float32))
    big = {
        "b": Tensor(np.array([0x3F80, 0xC020], ">u2"), "BFloat16Storage", 0, (2,), (1,)),
        "f": Tensor(np.array([1.5, -3.0], ">f4"), "FloatStorage", 0, (2,), (1,)),
    }
    write_archive(tmp_path / "b.pt", big, byteorder="big")
    found = read_state_dict(tmp_path / "b.pt")
    np.testing.assert_array_equal(found["b"], [1.0, -2.5])
    np.testing.assert_array_equal(found["f"], [1.5, -3.0])
    assert found["f"].dtype == np.dtype("f4")


CALLS = {
    "system": name_of("os", "system") + b"X\x05\x00\x00\x00false\x85R",
    "eval": name_of("builtins", "eval") + b"X\x03\x00\x00\x001/0\x85R",
    "instance": b"(ios\nsystem\n",
}


@FORMATS
@pytest.mark.parametrize("call", ["system", "eval", "instance"])
def test_a_call_is_refused_by_name_and_does_not_run(tmp_path, write, call, monkeypatch):
    ran = []
    monkeypatch.setattr("os.system", ran.append)
    write(tmp_path / "a.pt", {"weight": np.ones(2, np.float32), "trap": CALLS[call]})
    with pytest.raises(UserError, match=r"names (os\.system|builtins\.eval), which no tensor needs"):
        read_torch(tmp_path / "a.pt")
    assert not ran


def test_a_real_malicious_pickle_is_refused(tmp_path):
    class Trap:
        def __reduce__(self):
            return exec, (f"open({str(tmp_path / 'ran')!r}, 'w')",)

    with zipfile.ZipFile(tmp_path / "a.pt", "w") as archive:
        archive.writestr("a/data.pkl", pickle.dumps({"weight": Trap()}, protocol=5))
    with pytest.raises(UserError, match=r"builtins\.exec"):
        read_torch(tmp_path / "a.pt")
    assert not (tmp_path / "ran").exists()


def test_a_number_of_a_part_takes_no_memory(tmp_path):
    """Python's unpickler makes a table of 8 bytes for each number up to the one that is named."""
    write_archive(tmp_path / "a.pt", {"x": b"}r\xff\xff\xff\x7f"})
    with pytest.raises(UserError, match="a part has the number 2147483647"):
        read_torch(tmp_path / "a.pt")


def test_stand_ins_cannot_be_altered_for_later_files(tmp_path):
    rebuild = name_of("torch._utils", "_rebuild_tensor_v2")
    altered = rebuild + b"(N}(" + Writer().value("__defaults__") + Writer().value((1, 2, 3)) + b"utb"
    write_archive(tmp_path / "a.pt", {"x": altered})
    with pytest.raises(UserError, match="plain state dict"):
        read_state_dict(tmp_path / "a.pt")
    write_archive(tmp_path / "b.pt", {"x": np.ones(2, np.float32)})
    np.testing.assert_array_equal(read_state_dict(tmp_path / "b.pt")["x"], 1)


@FORMATS
def test_every_cut_is_an_error(tmp_path, write):
    write(tmp_path / "a.pt", {"weight": np.ones((3, 5), np.float32)})
    whole = (tmp_path / "a.pt").read_bytes()
    for length in range(0, len(whole), 37):
        (tmp_path / "cut.pt").write_bytes(whole[:length])
        with pytest.raises(UserError, match=r"cut\.pt (is broken or cut off|is not a file of torch)"):
            read_torch(tmp_path / "cut.pt")


@pytest.mark.parametrize(
    ("tensor", "message"),
    [
        (Tensor(np.zeros(4, "f4"), "FloatStorage", 1, (2, 2), (2, 1)), "reaches beyond the 4"),
        (Tensor(np.zeros(4, "f4"), "FloatStorage", 0, (2, 2), (2, -1)), "makes no sense"),
        (Tensor(np.zeros(4, "f4"), "FloatStorage", 0, (1 << 40, 1 << 40), (0, 0)), "reaches beyond"),
        (Tensor(np.zeros(4, "f4"), "FloatStorage", 0, (2, 2), (1,)), "broken"),
        (Tensor(np.zeros(4, "f4"), "DoubleStorage", 0, (4,), (1,)), "has 16 bytes"),
        (Tensor(np.zeros(4, "f4"), "ComplexFloatStorage", 0, (4,), (1,)), "torch.ComplexFloatStorage"),
    ],
)
def test_impossible_tensors_are_refused(tmp_path, tensor, message):
    write_archive(tmp_path / "a.pt", {"x": tensor})
    with pytest.raises(UserError, match=message):
        read_torch(tmp_path / "a.pt")


def test_a_container_that_holds_itself_is_refused(tmp_path):
    write_archive(tmp_path / "a.pt", {"x": b"]q\x63h\x63a"})
    with pytest.raises(UserError, match="holds itself"):
        read_torch(tmp_path / "a.pt")


def test_shared_containers_take_no_time(tmp_path):
    nested = b"]q\x00" + b"".join(b"](" + b"h%c" % i + b"h%c" % i + b"eq%c" % (i + 1) for i in range(60))
    write_archive(tmp_path / "a.pt", {"x": b"(" + nested + b"t"})
    assert len(read_torch(tmp_path / "a.pt")["x"]) == 61


def test_files_of_other_kinds_are_named(tmp_path):
    for name, content in (("a.pt", b"no torch file"), ("b.pt", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(UserError, match=r"not a file of torch\.save"):
            read_torch(tmp_path / name)
    with pytest.raises(UserError, match="does not exist"):
        read_torch(tmp_path / "none.pt")
    with zipfile.ZipFile(tmp_path / "c.pt", "w") as archive:
        archive.writestr("c/model.txt", "x")
    with pytest.raises(UserError, match=r"no file of torch\.save"):
        read_torch(tmp_path / "c.pt")
    write_archive(tmp_path / "d.pt", {"x": np.zeros(3, "f4")}, compression=zipfile.ZIP_DEFLATED)
    with pytest.raises(UserError, match="is compressed"):
        read_torch(tmp_path / "d.pt")


def test_contents_that_are_no_state_dict_are_described(tmp_path):
    write_archive(tmp_path / "a.pt", {"epoch": 3, "model": {"w": np.zeros(2, "f4")}})
    with pytest.raises(UserError, match=r"holds epoch, model; save model\.state_dict"):
        read_state_dict(tmp_path / "a.pt")
    write_archive(tmp_path / "b.pt", (1, 2))
    with pytest.raises(UserError, match="holds a tuple"):
        read_state_dict(tmp_path / "b.pt")


@pytest.mark.parametrize("zipped", [True, False])
def test_what_torch_itself_saves(tmp_path, zipped):
    torch = pytest.importorskip("torch")
    layer = torch.nn.Linear(3, 2)
    content = layer.state_dict()
    content |= {"half": torch.arange(4).half(), "bf16": torch.tensor([1.0, -2.5]).bfloat16()}
    content |= {"turned": torch.arange(6.0).reshape(2, 3).T, "parameter": torch.nn.Parameter(torch.ones(2))}
    content |= {"part": torch.arange(10)[3:8:2], "flag": torch.tensor([True, False]), "scalar": torch.tensor(3)}
    torch.save(content, tmp_path / "a.pt", _use_new_zipfile_serialization=zipped)
    found = read_state_dict(tmp_path / "a.pt")
    assert set(found) == set(content)
    for name, value in found.items():
        expected = content[name].detach()
        expected = expected.float() if expected.dtype == torch.bfloat16 else expected
        np.testing.assert_array_equal(value, expected.numpy(), err_msg=name)
        assert value.dtype == expected.numpy().dtype
