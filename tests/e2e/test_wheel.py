"""The wheel outside the checkout: one top-level name; the command `aerojax` with its configuration and weights."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
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
@pytest.mark.slow
def test_the_installed_command_classifies_a_sample(installed, tmp_path):
    done = aerojax(installed, tmp_path, "classify", "preset=smoke")
    assert done.returncode == 0, done.stderr[-3000:]
    (run,) = (tmp_path / "runs/classify").iterdir()
    result = json.loads((run / "result.json").read_text())
    assert sum(result["probabilities"].values()) == pytest.approx(1, abs=1e-5)
    assert (run / "report.html").is_file() and (tmp_path / "data/samples").is_dir()
    assert json.loads((run / "run.json").read_text())["commit"] is None
