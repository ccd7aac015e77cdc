"""The page of the Python interface says what the docstrings say; results and README what results/ say."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

import aerojax

DOCS = Path(__file__).resolve().parents[1] / "docs"


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
    """Every figure on the page and in README is looked up again."""
    assert results.PAGE.read_text(encoding="utf-8") == results.page(), "run `make docs`"
    written = results.README.read_text(encoding="utf-8")
    assert results.BEGIN in written and results.readme(written) == written, "run `make docs`"


def test_every_file_of_results_has_its_row(results):
    page = results.page()
    names = [path.name for path in (results.ROOT / "results").glob("*.json")]
    assert names and all(f"| `{name}` | `" in page for name in names)


FIGURE = re.compile(r"\d[\d.,]*\s?(%|dB\b|times\b|images/s|MB\b|points?\b)|·10[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]")
"""What is measured, and so must be looked up."""


@pytest.mark.parametrize("name", ["results.md", "readme.md"])
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


@pytest.mark.parametrize("page", ["README.md", *(f"docs/{name}.md" for name in ("results", "capture", "data_set"))])
def test_links_lead_somewhere(page):
    path = DOCS.parent / page
    targets = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8"))
    assert all((path.parent / target).exists() for target in targets), targets
