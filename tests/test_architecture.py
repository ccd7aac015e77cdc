"""The house rules that a machine can hold: import order, file sizes, names, and where `kernels` comes from."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import kernels

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted(p for top in ("aerojax", "kernels", "experiments") for p in (ROOT / top).rglob("*.py"))
ORDER = (
    "base",
    "geometry",
    "gaussians",
    "capture",
    "simulate",
    "segment",
    "reconstruct",
    "classify",
    "pipeline",
    "experiments",
)
BASE = ("types", "errors", "config", "")
ASIDE = {room: ("base", "geometry", "gaussians", "capture", room) for room in ("training", "evaluate", "view")}
KERNEL_USERS = ("kernels", "gaussians", "simulate", "reconstruct", "experiments")
MOST_LINES = 500
MOST_LINES_OF_AN_ACT = 120
FORBIDDEN_NAMES = ("utils", "common", "helpers", "misc")


def room_of(module: str) -> str:
    """The room that a dotted module lives in."""
    parts = module.split(".")
    if parts[0] in ("experiments", "kernels"):
        return parts[0]
    inner = parts[1] if len(parts) > 1 else ""
    return "base" if inner in BASE else inner


def imports_of(path: Path) -> set[str]:
    """Dotted names of every absolute import in a file, functions included."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            # `from aerojax import pipeline` names a module by its last part.
            base = node.module or ""
            found |= {f"{base}.{a.name}" for a in node.names} if base == "aerojax" else {base}
    return found


def allowed_rooms(room: str) -> tuple[str, ...]:
    """Rooms that a file of `room` may import from."""
    if room == "kernels":
        return ("kernels",)
    if room in ASIDE:
        return ASIDE[room]
    left = ORDER[: ORDER.index(room) + 1]
    beside = tuple(ASIDE) if room == "experiments" else ()
    return left + beside + (("kernels",) if room in KERNEL_USERS else ())


def violations(room: str, imports: set[str]) -> list[str]:
    """Imports that break the order or bring Hydra where it does not belong."""
    ours = [m for m in imports if m.split(".")[0] in ("aerojax", "kernels", "experiments")]
    wrong = [m for m in ours if room_of(m) not in allowed_rooms(room)]
    if room != "experiments":
        wrong += [m for m in imports if m.split(".")[0] in ("hydra", "omegaconf")]
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
        ("kernels", "aerojax.core.types"),
        ("capture", "kernels.splat.blend"),
        ("training", "aerojax.classify.mambasplat.model"),
    ],
)
def test_the_import_check_can_fail(room, module):
    assert violations(room, {module}) == [module]


@pytest.mark.parametrize(
    "path", [*SOURCES, *sorted((ROOT / "tests").rglob("*.py"))], ids=lambda p: str(p.relative_to(ROOT))
)
def test_files_are_small_and_named(path):
    assert len(path.read_text().splitlines()) <= MOST_LINES
    assert path.stem not in FORBIDDEN_NAMES


def test_experiments_compose_only():
    acts = [
        ROOT / "experiments" / f"{config.stem}.py" for config in (ROOT / "conf").glob("*.yaml") if config.stem != "base"
    ]
    assert acts
    for path in acts:
        assert len(path.read_text().splitlines()) <= MOST_LINES_OF_AN_ACT, f"{path.name}: an experiment only composes"


def test_kernels_are_ours():
    assert kernels.__file__ is not None
    assert Path(kernels.__file__).is_relative_to(ROOT), "another distribution named 'kernels' shadows ours"
