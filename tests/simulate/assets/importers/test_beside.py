"""Files that a model names are found in its folder, and nowhere else."""

from __future__ import annotations

import json

import pytest
from support.gltf_files import triangle
from support.model_imports import import_model

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.beside import find_beside


@pytest.mark.parametrize("name", ["a.png", "A.PNG", "C:\\art\\a.png", "/elsewhere/a.png", ' "a.png" ', "sub/../a.png"])
def test_files_in_the_folder_are_found(tmp_path, name):
    (tmp_path / "sub").mkdir()
    (tmp_path / "a.png").touch()
    found = find_beside(tmp_path, name)
    assert found is not None and found.samefile(tmp_path / "a.png")


def test_files_outside_the_folder_are_not(tmp_path):
    folder, outside = tmp_path / "model", tmp_path / "secret.bin"
    folder.mkdir()
    outside.touch()
    (folder / "link.bin").symlink_to(outside)
    for name in (
        str(outside),
        "../secret.bin",
        "..\\secret.bin",
        "link.bin",
        "http://localhost:9/x",
        "x" * 300,
        "\0",
        "\ud800",
    ):
        assert find_beside(folder, name) is None


def test_a_model_reads_no_buffer_from_elsewhere(tmp_path):
    folder, glb = tmp_path / "model", triangle()
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(glb.binary)
    tree = {**glb.tree, "buffers": [{"uri": "../secret.bin", "byteLength": len(glb.binary)}]}
    (folder / "a.gltf").write_text(json.dumps(tree))
    with pytest.raises(UserError, match=r"\.\./secret\.bin is missing"):
        import_model(folder, "a.gltf")
