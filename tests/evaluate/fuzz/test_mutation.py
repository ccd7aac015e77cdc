"""Changes know the structure: lengths and checksums stay right where they should, and cases repeat."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib

import numpy as np
import pytest

from aerojax.evaluate.fuzz import mutation
from experiments._fuzz import inputs


def many(change, content: bytes, count: int = 60) -> list[bytes]:
    return [change(content, np.random.default_rng(seed)) for seed in range(count)]


def test_lengths_of_glb_stay_right():
    for changed in many(mutation.mutate_glb, inputs.glb()["a.glb"]):
        magic, version, size = struct.unpack_from("<4sII", changed)
        (chunk,) = struct.unpack_from("<I", changed, 12)
        assert (magic, version, size) == (b"glTF", 2, len(changed)) and chunk % 4 == 0
        assert changed[20 + chunk + 4 :][:4] == b"BIN\0"


def test_checksums_of_png_stay_right():
    different = 0
    for changed in many(mutation.mutate_png, inputs.picture(0, 0, ".png")):
        place = 8
        while place < len(changed):
            (size,) = struct.unpack_from(">I", changed, place)
            body = changed[place + 4 : place + 8 + size]
            assert struct.unpack_from(">I", changed, place + 8 + size)[0] == zlib.crc32(body)
            place += 12 + size
        different += changed != inputs.picture(0, 0, ".png")
    assert different > 50


def test_archives_stay_archives():
    for changed in many(mutation.mutate_zip, inputs.torch_archive()):
        with zipfile.ZipFile(io.BytesIO(changed)) as archive:
            assert archive.testzip() is None


def test_json_stays_json_and_changes():
    content = inputs.manifest()
    changed = [x for x in many(mutation.mutate_json, content, 200) if not x.startswith(b"[[")]
    trees = [json.loads(x.removeprefix(b"\xef\xbb\xbf")) for x in changed]
    assert np.mean([tree != json.loads(content) for tree in trees]) > 0.8


@pytest.mark.parametrize("name", ["a.json", "a.ply", "a.glb", "a.safetensors", "a.pt", "a.png", "a.usda", "a.mp4"])
@pytest.mark.parametrize("content", [b"", b"x", b"{}", b"ply\nend_header\n", bytes(64)])
def test_any_content_is_changed_without_failure(name, content):
    for seed in range(20):
        one, again = (mutation.mutate_file(name, content, np.random.default_rng(seed)) for _ in range(2))
        assert one == again
