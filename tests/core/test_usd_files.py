"""A stage that cannot be written whole is refused by name and leaves nothing under its name."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from aerojax.core.errors import UserError
from aerojax.core.usd_files import create_stage, export_stage, save_stage
from aerojax.evaluate.kills.small_disk import small_disk


def fill(stage: Usd.Stage) -> Usd.Stage:
    points = np.random.default_rng(0).random((20_000, 3), np.float32)  # 240 kB that do not compress
    UsdGeom.Mesh.Define(stage, "/M").CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    return stage


@pytest.mark.parametrize("suffix", ["usdc", "usda"])
@pytest.mark.parametrize("export", [False, True])
def test_a_full_disk(tmp_path, suffix, export):
    with small_disk(tmp_path / "disk", 65536) as disk:
        if disk is None:
            pytest.skip("this process may not mount")
        path = tmp_path / f"disk/a.{suffix}"
        stage = fill(Usd.Stage.CreateInMemory() if export else create_stage(path))
        with pytest.raises((UserError, OSError)) as refused:
            export_stage(stage, path) if export else save_stage(stage)
        assert isinstance(refused.value, OSError) or refused.value.code == "unwritable"
        assert list((tmp_path / "disk").iterdir()) == []


def test_a_read_only_disk(tmp_path):
    with small_disk(tmp_path / "disk", 65536) as disk:
        if disk is None:
            pytest.skip("this process may not mount")
        disk.forbid_writing()
        with pytest.raises(UserError, match=r"c\.usdc: cannot be written"):
            create_stage(tmp_path / "disk/c.usdc")


def test_an_export_replaces_a_file(tmp_path):
    path = tmp_path / "a.usda"
    for name in ("/A", "/B"):
        stage = Usd.Stage.CreateInMemory()
        stage.DefinePrim(name)
        export_stage(stage, path)
        assert [p.name for p in tmp_path.iterdir()] == ["a.usda"] and name[1:] in path.read_text()
