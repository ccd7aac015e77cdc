"""What counts as output, and what two outputs may differ in."""

from __future__ import annotations

import json

from aerojax.evaluate.kills.outputs import BROKEN, differences, halves, marks


def weights(minutes: float, tensor: bytes) -> bytes:
    record = json.dumps({"seed": 0, "minutes": minutes})
    header = json.dumps({"__metadata__": {"card": json.dumps({"record": record})}}).encode()
    return len(header).to_bytes(8, "little") + header + tensor


def test_times_and_unfinished_files_do_not_count(tmp_path):
    for name, minutes in (("a", 1.0), ("b", 2.0)):
        folder = tmp_path / name
        (folder / "x.partial").mkdir(parents=True)
        (folder / "x.partial/000.png").write_text(name)
        (folder / ".hidden.tmp.npz").write_text(name)
        (folder / "metrics.json").write_text(
            json.dumps({"accuracy": 0.5, "minutes": minutes, "deep": [{"date": name}]})
        )
        (folder / "weights.safetensors").write_bytes(weights(minutes, b"1234"))
    one, other = marks(tmp_path / "a"), marks(tmp_path / "b")
    assert set(one) == {"metrics.json", "weights.safetensors"} and differences(one, other) == ()
    (tmp_path / "b/weights.safetensors").write_bytes(weights(1.0, b"1235"))
    assert differences(one, marks(tmp_path / "b")) == ("weights.safetensors differs",)
    assert differences({"a": "1", "c": "1"}, {"b": "1", "c": "1"}) == ("b is missing", "a is too much")


def test_half_files_are_found(tmp_path):
    (tmp_path / "a.json").write_text('{"x": 1')
    (tmp_path / "b.npz").write_bytes(b"half")
    (tmp_path / "history.jsonl").write_text("{}\n")
    found = marks(tmp_path)
    assert found["a.json"] == BROKEN
    wanted = {"a.json": "1", "b.npz": "2", "history.jsonl": "3"}
    assert halves(found, wanted, ("*history.jsonl",)) == ("a.json", "b.npz")
    assert halves({"b.npz": "2"}, wanted) == ()
    assert marks(tmp_path, ignoring=("*.npz",)).keys() == {"a.json", "history.jsonl"}
