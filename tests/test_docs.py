"""The page of the interface says what the docstrings say, results and limits what results/ say; the site builds."""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
import shlex
import subprocess
import sys
from types import ModuleType

import pytest
import yaml
from support.act_configs import config_of, values_of
from support.pages import DOCS, ROOT, fenced

import aerojax
from aerojax.core.config import to_dataclass
from aerojax.core.provenance import command_of_result
from experiments._launch.arguments import with_keys, with_quotes


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def maker():
    return script("make_api")


@pytest.fixture(scope="module")
def results():
    return script("make_results")


def test_the_page_is_current(maker):
    assert maker.PAGE.read_text(encoding="utf-8") == maker.page(), "run `make docs`"


def test_every_public_name_is_on_the_page(maker):
    headings = {line[4:] for line in maker.page().splitlines() if line.startswith("### ")}
    assert headings == set(aerojax.__all__) - {"__version__"}


def test_sections_become_lists(maker):
    text = "One.\n\n    a = b\n\nArgs:\n    x: first,\n        and more.\n    y: second.\n\nAfter."
    wanted = "One.\n\n    a = b\n\n**Args**\n\n- x: first,\n  and more.\n- y: second.\n\nAfter."
    assert maker.prose("a, b: fields\n    of two.\nMore text.") == "- a, b: fields\n  of two.\nMore text."
    assert maker.prose(text) == wanted


def test_a_name_that_moved_is_an_error(maker):
    with pytest.raises(ValueError, match="render is not defined"):
        maker.described("render", ast.parse("from a import render"))


# Figures


def test_the_results_are_current(results):
    """Every figure on the pages and in README is looked up again."""
    for name in results.PAGES:
        assert (DOCS / name).read_text(encoding="utf-8") == results.made(name), f"{name}: run `make docs`"
    written = results.README.read_text(encoding="utf-8")
    assert results.BEGIN in written and results.readme(written) == written, "run `make docs`"


def test_the_plots_are_current(results):
    drawn = results.plots()
    assert {path.name for path in (DOCS / "plots").iterdir()} == {place.rpartition("/")[2] for place in drawn}
    for place, text in drawn.items():
        assert (DOCS / place).read_text(encoding="utf-8") == text, f"{place}: run `make docs`"


def test_every_file_of_results_has_its_row(results):
    page = results.made("results.md")
    names = [path.name for path in (results.ROOT / "results").glob("*.json")]
    assert names and all(f"| `{name}` | `" in page for name in names)


FIGURE = re.compile(r"\d[\d.,]*\s?(%|dB\b|times\b|images/s|MB\b|points?\b)|·10[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]")
"""What is measured, and so must be looked up."""


@pytest.mark.parametrize("name", ["results.md", "limits.md", "scale.md", "readme.md"])
def test_templates_hold_no_figures_of_their_own(results, name):
    text = results.PLACE.sub("", (results.TEMPLATES / name).read_text()).replace("95 % interval", "")
    assert not FIGURE.search(text), FIGURE.search(text)


def test_readme_holds_figures_in_its_results_alone(results):
    before, _, rest = results.README.read_text(encoding="utf-8").partition(results.BEGIN)
    outside = before + rest.partition(results.END)[2]
    assert not FIGURE.search(outside), FIGURE.search(outside)
    assert len(results.README.read_text(encoding="utf-8").splitlines()) <= 150


def test_paths_into_results(results):
    values = {"rows": [{"a": "x", "n": 66.0, "v": 1}, {"a": "y", "n": 5.0, "v": 4}], "b": {"c": 7, "d": {"v": 2}}}
    assert results.lookup(values, "rows[a=y].v") == 4 and results.lookup(values, "rows[a=x,n=66].v") == 1
    assert results.lookup(values, "rows[1].n") == 5.0 and results.lookup(values, "b.c") == 7
    assert results.lookup(values, "max(rows.*.v)") == 4 and results.lookup(values, "b.*.v") == [2]
    assert results.lookup(values, "count(rows)") == 2 and results.lookup(values, "median(rows.*.v)") == 2.5
    with pytest.raises(KeyError, match="fits 0 rows"):
        results.lookup(values, "rows[a=z].v")


def test_formats_of_figures(results):
    assert results.formatted(0.95833, ".1%") == "95.8 %" and results.formatted(2.247e-05, ".1e") == "2.2·10⁻⁵"
    assert results.formatted(3200, ",") == "3,200" and results.formatted("views", "") == "views"


def test_the_last_tolerated_level_is_the_one_before_the_first_loss(results, monkeypatch):
    rows = [
        {"factor": factor, "value": value, "accuracy": 0.9 - loss, "difference": -loss}
        for factor, *levels in (
            ("calibration_deg", (0.0, 0.0), (0.3, 0.04), (1.0, 0.2)),
            ("clock_ms", (0.0, 0.0), (33.0, 0.01)),
            ("mask_growth", (-2.0, 0.3), (-1.0, 0.0), (0.0, 0.0), (1.0, 0.01)),
            ("cameras", (8.0, 0.0), (3.0, 0.1)),
            ("width_px", (8.0, 0.3), (80.0, 0.0)),
            ("distance_m", (16.0, 0.0), (280.0, 0.0)),
        )
        for value, loss in levels
    ]
    monkeypatch.setattr("result_tables.load", lambda name: {"rows": rows})
    lines = dict(line.strip("| ").split(" | ", 1) for line in results.tolerances().splitlines()[2:])
    assert lines["cameras turned, °"] == "0 to 1 | 0.3 (86.0 %) | 1 (70.0 %)"
    assert lines["masks eroded, pixels"] == "0 to 2 | 1 (90.0 %) | 2 (60.0 %)"
    assert lines["masks dilated, pixels"] == "0 to 1 | 1 (89.0 %) | none tried"
    assert lines["cameras"] == "8 to 3 | 8 (90.0 %) | 3 (80.0 %)"
    assert lines["width of the object, pixels"] == "80 to 8 | 80 (90.0 %) | 8 (60.0 %)"


# Pages

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md"))]


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_links_lead_somewhere(path):
    targets = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8"))
    assert all((path.parent / target).exists() for target in targets), targets


def commands() -> list[list[str]]:
    """Every command of the pages and of results that starts an act, without what its line says of it."""
    lines = [line for path in PAGES for block in fenced(path, "sh", "") for line in block.splitlines()]
    results = [json.loads(path.read_text(encoding="utf-8")) for path in sorted((ROOT / "results").glob("*.json"))]
    lines += filter(None, map(command_of_result, results))
    found = [re.fullmatch(r"(?:\.venv/bin/)?(?:python -m experiments\.|aerojax )(\w+.*)", line) for line in lines]
    return [shlex.split(one[1], comments=True) for one in found if one and not one[1].startswith("benchmark ")]


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_commands_are_understood(words):
    """Acts, keys and values of the pages' commands are those that there are."""
    act, *given = words
    multirun = "-m" in given or act == "compare_classifiers"
    values = with_keys([word for word in given if word != "-m"], config_of(act))
    if multirun:  # values of a sweep are composed one at a time
        values = [re.sub(r"=range\(.*\)$", "=0", value) for value in values if not value.startswith("hydra/")]
        values = [re.sub(r"=(\w+),.*$", r"=\1", value) for value in values]
    to_dataclass(values_of(act, *with_quotes(values, config_of(act))), config_of(act))


def test_the_citation_names_this_version_and_the_thesis():
    """The file itself was checked with the schema of CFF 1.2.0."""
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["cff-version"] == "1.2.0" and cited["version"] == aerojax.__version__
    assert cited["license"] == "Apache-2.0" and [one["type"] for one in cited["references"]] == ["thesis"]


def test_the_site_builds_without_a_warning(tmp_path):
    if importlib.util.find_spec("material") is None:
        pytest.skip("mkdocs-material is not installed; it comes with the extra `docs`, or with `make site-tools`")
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(
        build, cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True
    )
    assert done.returncode == 0 and "WARNING" not in done.stderr, done.stderr
    made = {path.name for path in (tmp_path / "site").iterdir()}
    assert {f"{path.stem}.html" for path in DOCS.glob("*.md")} <= made and "templates" not in made
    page = (tmp_path / "site/index.html").read_text(encoding="utf-8")
    fetched = re.findall(r'(?:src|href)="(https?://[^"]+)"', page)
    assert not fetched, fetched
