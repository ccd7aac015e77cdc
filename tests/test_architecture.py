"""The house rules that a machine can hold: import order, doors, one home for each fact, file sizes, names."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import kernels

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted(p for top in ("aerojax", "kernels", "experiments") for p in (ROOT / top).rglob("*.py"))
ACTS = sorted(p.stem for p in (ROOT / "conf").glob("*.yaml") if p.stem not in ("base", "__init__"))
BASE = ("core", "geometry", "gaussians", "capture")
DATA = (*BASE, "data")
STAGES = ("segment", "track", "reconstruct", "classify")
SEEN: dict[str, tuple[str, ...]] = {
    **{room: BASE[: index + 1] for index, room in enumerate(BASE)},
    "data": DATA,
    "simulate": (*DATA, "simulate"),
    **{stage: (*BASE, stage) for stage in STAGES},  # of another stage only its door, see `allowed`
    "pipeline": (*DATA, *STAGES, "pipeline"),
    "factory": (*DATA, *STAGES, "simulate", "pipeline", "factory"),  # it flies what the pipeline reconstructs
    "evaluate": (*DATA, "evaluate"),
    "dataset_qa": (*DATA, "simulate", "evaluate", "dataset_qa"),  # it opens the stages that the simulator made
    "training": (*DATA, "evaluate", "training"),  # validation counts as evaluation does
    "view": (*DATA, "evaluate", "dataset_qa", "view"),
    "serve": (*DATA, *STAGES, "evaluate", "pipeline", "view", "serve"),
    "package": (*DATA, *STAGES, "simulate", "pipeline", "training", "evaluate", "dataset_qa", "view", "package"),
    "kernels": ("kernels",),
}
"""Which rooms a file of a room may import from; `experiments` sees all, and of itself only its private packages."""
DOORS_SEEN_BY = ("training", "evaluate", *STAGES)
KERNEL_USERS = (
    "kernels",
    "dataset_qa",
    "gaussians",
    "simulate",
    "reconstruct",
    "segment",
    "classify",  # farthest points of a clip's tubes
    "data",
    "experiments",
)
MOST_LINES = 500
MOST_LINES_OF_AN_ACT = 120
FORBIDDEN_NAMES = ("utils", "common", "helpers", "misc")


def room_of(module: str) -> str:
    """The room that a dotted module lives in; `package` is what stands at the top of `aerojax`."""
    parts = module.split(".")
    if parts[0] in ("experiments", "kernels"):
        return parts[0]
    if parts[1:3] == ["evaluate", "dataset_qa"]:
        return "dataset_qa"
    if parts[1:3] == ["pipeline", "factory"]:
        return "factory"
    return parts[1] if len(parts) > 1 and (ROOT / "aerojax" / parts[1]).is_dir() else "package"


def imports_of(path: Path) -> set[str]:
    """Dotted names of every absolute import in a file, functions included; of `from a import b`, `a.b` too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            base = node.module or ""
            submodules = {f"{base}.{a.name}" for a in node.names if is_module(f"{base}.{a.name}")}
            found |= submodules or {base}
    return found


def is_module(dotted: str) -> bool:
    place = ROOT / dotted.replace(".", "/")
    return place.is_dir() or place.with_suffix(".py").is_file()


def allowed(room: str, module: str) -> bool:
    """Whether a file of `room` may import `module` of ours."""
    target, parts = room_of(module), module.split(".")
    if target == "kernels":
        return room in KERNEL_USERS
    if module.startswith("experiments._launch") and room == "package":
        return True  # `python -m aerojax` starts an act
    if room == "experiments":
        return target != "experiments" or len(parts) < 2 or parts[1] not in ACTS
    if target in STAGES and room in DOORS_SEEN_BY and room != target:
        return parts[2:] == ["base"]
    return target in SEEN[room]


def violations(room: str, imports: set[str]) -> list[str]:
    """Imports that break the order or bring Hydra where it does not belong."""
    wrong = [m for m in imports if m.split(".")[0] in ("aerojax", "kernels", "experiments") and not allowed(room, m)]
    if room != "experiments":
        wrong += [m for m in imports if m.split(".")[0] in ("hydra", "omegaconf", "rich")]
    return wrong


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_point_left(path):
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    assert violations(room_of(module), imports_of(path)) == []


@pytest.mark.parametrize(
    ("room", "module"),
    [
        ("geometry", "aerojax.gaussians.render"),
        ("simulate", "aerojax.reconstruct.hull"),
        ("view", "aerojax.pipeline.offline"),
        ("classify", "hydra"),
        ("data", "rich"),
        ("kernels", "aerojax.core.types"),
        ("capture", "kernels.splat"),
        ("training", "aerojax.classify.mambasplat.model"),
        ("evaluate", "aerojax.classify.load"),
        ("classify", "aerojax.reconstruct.hull"),
        ("track", "aerojax.segment.given"),
        ("pipeline", "experiments._launch.command"),
        ("pipeline", "aerojax.serve.service"),
        ("experiments", "experiments.train_classifier"),
    ],
)
def test_the_import_check_can_fail(room, module):
    assert violations(room, {module}) == [module]


@pytest.mark.parametrize(
    "module", ["aerojax.classify.base", "aerojax.reconstruct.base", "aerojax.segment.base", "aerojax.track.base"]
)
def test_doors_may_be_seen(module):
    assert violations("evaluate", {module}) == [] == violations("training", {module})


ONE_HOME = {
    "sRGB": (r"12\.92", {"aerojax/core/colour.py", "kernels/rays/colour.py"}),  # the second in Warp's own language
    "look_at": (r"^def look_at\(", {"aerojax/geometry/cameras.py"}),
    "pinhole projection": (
        r"^def _?project(_points)?\(",
        {"aerojax/geometry/cameras.py", "kernels/splat/projection.py"},
    ),
    "boxes": (r"^Box = ", {"aerojax/core/types.py"}),
    "splits": (r"^SPLITS\b", {"aerojax/data/splits.py"}),
    "whole JSON files": (r"def _?write_json\(", {"aerojax/core/files.py"}),
    "temporary files": (r"mkstemp|\.tmp\"", {"aerojax/core/files.py"}),
    "hashes": (
        r"blake2b|sha256\(",
        {"aerojax/core/seeds.py", "aerojax/core/files.py", "aerojax/view/templates.py"},  # a policy names its script
    ),
    "published normalisation": (r"^def normalise_published\(", {"aerojax/classify/released/normalisation.py"}),
}
"""Facts with one definition: a pattern of it, and where it may stand."""


@pytest.mark.parametrize("fact", ONE_HOME)
def test_a_fact_has_one_home(fact):
    pattern, homes = ONE_HOME[fact]
    found = {
        str(p.relative_to(ROOT)) for p in SOURCES if re.search(pattern, p.read_text(), flags=re.MULTILINE) is not None
    }
    assert found <= homes and found, f"{fact} is defined in {sorted(found)}"


@pytest.mark.parametrize(
    "path", [*SOURCES, *sorted((ROOT / "tests").rglob("*.py"))], ids=lambda p: str(p.relative_to(ROOT))
)
def test_files_are_small_and_named(path):
    assert len(path.read_text().splitlines()) <= MOST_LINES
    assert path.stem not in FORBIDDEN_NAMES


def test_experiments_are_acts_that_compose_only():
    files = {path.stem for path in (ROOT / "experiments").glob("[!_]*.py")}
    assert files - {"benchmark"} == set(ACTS), "a file of experiments is an act with a configuration of its name"
    for stem in files:
        lines = (ROOT / "experiments" / f"{stem}.py").read_text().splitlines()
        assert len(lines) <= MOST_LINES_OF_AN_ACT, f"{stem}: an experiment only composes"


def test_tests_mirror_the_source():
    rooms = {p.name for top in ("aerojax", ".") for p in (ROOT / top).iterdir() if p.is_dir()}
    folders = {p.parent.relative_to(ROOT / "tests").parts[0] for p in (ROOT / "tests").rglob("*/test_*.py")}
    assert folders - {"laws", "parity", "e2e"} <= rooms


def test_kernels_are_ours():
    assert kernels.__file__ is not None
    assert Path(kernels.__file__).is_relative_to(ROOT), "another distribution named 'kernels' shadows ours"
