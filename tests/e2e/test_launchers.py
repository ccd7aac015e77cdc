"""A data set in shards through the launchers of a cluster, in their local modes."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

LAUNCHERS = {
    "submitit_local": ("hydra_plugins.hydra_submitit_launcher", ()),
    "ray": ("hydra_plugins.hydra_ray_launcher", ("+hydra.launcher.ray.init.num_cpus=2",)),
}


def _installed(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


@pytest.mark.slow
@pytest.mark.parametrize("launcher", LAUNCHERS)
def test_shards_of_a_launcher_make_one_data_set(launcher, tmp_path):
    plugin, more = LAUNCHERS[launcher]
    if not _installed(plugin):
        pytest.skip(f"{plugin} is not installed; it comes with the extra `cluster`")
    sizes = ("rig=sim1", "preset=smoke", "classes=[drone]", "frames=1", "workers=1", "shard=0,1", "shards=2")
    where = (f"folder={tmp_path}/data", f"hydra.sweep.dir={tmp_path}/sweep", f"hydra/launcher={launcher}")
    command = [sys.executable, "-m", "experiments.generate_dataset", "-m", *sizes, *where, *more]
    environment = {**os.environ, "RAY_AUTH_MODE": "disabled"}
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr[-3000:]
    manifest = json.loads((tmp_path / "data/dataset.json").read_text())
    assert len(manifest["sequences"]) == manifest["counts"]["sim1"]["sequences"] == 4
