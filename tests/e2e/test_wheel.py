"""The wheel outside the checkout: one top-level name; the command `aerojax` with its configuration and weights."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest
from support.pages import ROOT, fenced

import aerojax as library

FOLDERS = ("aerojax", "kernels", "experiments", "conf")
FILES = ("setup.py", "pyproject.toml", "README.md", "LICENSE")
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check")

WITHOUT_CHECKOUT = """
import sys
class Refusal:
    def find_spec(self, name, path=None, target=None):
        if name in ("kernels", "experiments", "conf"):
            raise ImportError(f"{name} belongs to the checkout")
sys.meta_path.insert(0, Refusal())
"""
"""Sees to it that this environment's editable aerojax does not help the wheel."""

needs_setuptools = pytest.mark.skipif(
    importlib.util.find_spec("setuptools") is None, reason="setuptools is not installed; it comes with the extra `dev`"
)


@pytest.fixture(scope="module")
def recipe():
    """The functions of setup.py."""
    spec = importlib.util.spec_from_file_location("recipe_of_the_wheel", ROOT / "setup.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@needs_setuptools
def test_imports_are_rewritten(recipe):
    source = (
        '"""`python -m experiments.classify` and kernels."""\n'
        "import numpy, kernels.splat as splat  # kernels\n"
        "from kernels import rays\n"
        "def f():\n"
        "    é = 1; from experiments._launch.command import (\n        Run as kernels,\n    )\n"
        "    from aerojax.kernels_of import conf\n"
        "    return kernels\n"
    )
    assert recipe.rewritten_source(source) == (
        '"""`aerojax classify` and kernels."""\n'
        "import numpy, aerojax.kernels.splat as splat  # kernels\n"
        "from aerojax.kernels import rays\n"
        "def f():\n"
        "    é = 1; from aerojax.experiments._launch.command import (\n        Run as kernels,\n    )\n"
        "    from aerojax.kernels_of import conf\n"
        "    return kernels\n"
    )
    with pytest.raises(ValueError, match=r"line 1: import kernels\.splat needs `as`"):
        recipe.rewritten_source("import kernels.splat\n")


@needs_setuptools
def test_configuration_is_rewritten(recipe):
    text = (
        "table: {_target_: experiments._launch.sweep_table.SweepTable}\n# experiments.x; python -m experiments.y a=1\n"
    )
    assert recipe.rewritten_config(text) == (
        "table: {_target_: aerojax.experiments._launch.sweep_table.SweepTable}\n# experiments.x; aerojax y a=1\n"
    )


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Built from a copy of the sources, in which an older build has left a module."""
    place = tmp_path_factory.mktemp("wheel")
    for name in FOLDERS:
        shutil.copytree(ROOT / name, place / "source" / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in FILES:
        shutil.copy(ROOT / name, place / "source" / name)
    old = place / "source/build/lib/kernels/renamed_since.py"
    old.parent.mkdir(parents=True)
    old.touch()
    build = (*PIP, "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", place, place / "source")
    subprocess.run(build, check=True, capture_output=True)
    (made,) = place.glob("*.whl")
    return made


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Path:
    """A folder with the wheel's content, as in site-packages."""
    target = tmp_path_factory.mktemp("site-packages")
    install = (*PIP, "install", "--quiet", "--no-deps", "--no-index", "--target", target, wheel)
    subprocess.run(install, check=True, capture_output=True)
    (target / "sitecustomize.py").write_text(WITHOUT_CHECKOUT)
    return target


def aerojax(installed: Path, cwd: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the installed command with the packages of this environment."""
    environment = {**os.environ, "PYTHONPATH": str(installed), "PYTHONSAFEPATH": "1"}
    command = [sys.executable, installed / "bin" / "aerojax", *arguments]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)


@needs_setuptools
@pytest.mark.slow
def test_a_wheel_holds_all_sources_below_one_name(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        top = next(archive.read(name) for name in names if name.endswith("top_level.txt"))
    tops = {name.split("/")[0] for name in names}
    assert {t for t in tops if not t.endswith(".dist-info")} == {"aerojax"} and top == b"aerojax\n"
    inside = {name.removeprefix("aerojax/") for name in names if name.startswith("aerojax/")}
    sources = {p.relative_to(ROOT) for f in FOLDERS for p in (ROOT / f).rglob("*") if p.is_file()}
    expected = {str(p).removeprefix("aerojax/") for p in sources if "__pycache__" not in p.parts}
    assert inside == expected


@needs_setuptools
@pytest.mark.slow
def test_the_installed_command_lists_acts_and_configuration(installed, tmp_path):
    done = aerojax(installed, tmp_path, "--help")
    assert done.returncode == 0 and "classify " in done.stdout, done.stderr
    done = aerojax(installed, tmp_path, "classify", "--help")
    assert done.returncode == 0 and done.stdout.startswith("aerojax classify [CAPTURE] [key=value ...]"), done.stderr
    assert not {"kernels", "experiments", "conf"} & {path.name for path in installed.iterdir()}


@needs_setuptools
@pytest.mark.long
def test_the_installed_command_classifies_a_sample(installed, tmp_path):
    done = aerojax(installed, tmp_path, "classify", "preset=smoke")
    assert done.returncode == 0, done.stderr[-3000:]
    (run,) = (tmp_path / "runs/classify").iterdir()
    result = json.loads((run / "result.json").read_text())
    assert sum(result["probabilities"].values()) == pytest.approx(1, abs=1e-5)
    assert (run / "report.html").is_file() and (tmp_path / "data/samples").is_dir()
    assert json.loads((run / "run.json").read_text())["commit"] is None


# An environment that has nothing but the wheel and what it asks for


def outside(program: Path, cwd: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a program as a user does who has no checkout."""
    named = ("PYTHONPATH", "PYTHONHOME", "PYTHONSAFEPATH", "VIRTUAL_ENV")
    environment = {key: value for key, value in os.environ.items() if key not in named}
    command = [program, *arguments]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def elsewhere(wheel, tmp_path_factory) -> Path:
    """The programs of a fresh environment; its packages are those that the wheel asks for, in the locked versions."""
    place = tmp_path_factory.mktemp("clean")
    venv.create(place / "env", with_pip=True)
    programs = place / "env/bin"
    locked = ("--constraint", ROOT / "requirements.lock")
    install = ("-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    done = outside(programs / "python", place, *install, *locked, wheel)
    if done.returncode and "Failed to establish a new connection" in done.stderr:
        pytest.skip("the packages that the wheel asks for can not be fetched here")
    assert done.returncode == 0, done.stderr[-3000:]
    return programs


@needs_setuptools
@pytest.mark.long
def test_a_clean_environment_elsewhere_does_the_quick_start_and_exports_gaussians(elsewhere, tmp_path):
    done = outside(elsewhere / "aerojax", tmp_path, "classify", "preset=smoke")
    assert done.returncode == 0, done.stderr[-3000:]
    (capture,) = (tmp_path / "data/samples").iterdir()
    done = outside(elsewhere / "aerojax", tmp_path, "classify", capture, "export=[ply]", "hydra.run.dir=taken")
    assert done.returncode == 0, done.stderr[-3000:]
    result = json.loads((tmp_path / "taken/result.json").read_text())
    assert result["status"] in ("ok", "unsure") and (tmp_path / "taken/report.html").is_file()
    files = sorted((tmp_path / "taken/export/ply").iterdir())
    assert [path.name for path in files] == [f"frame_{number:06d}.ply" for number in result["frames"]]
    for path, row in zip(files, result["track"], strict=True):
        gaussians, origin = library.read_placed_ply(path)
        assert gaussians.mean.shape == (1024, 3)
        assert np.linalg.norm(origin + np.asarray(gaussians.mean).mean(axis=0) - row["position"]) < 0.5

    (tmp_path / "capture").symlink_to(capture)
    (code,) = fenced(ROOT / "README.md", "python")
    done = outside(elsewhere / "python", tmp_path, "-c", code)
    assert done.returncode == 0, done.stderr[-3000:]
