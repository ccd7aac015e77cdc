"""The page of the Python interface says what the docstrings say."""

from __future__ import annotations

import ast
import importlib.util
from pathlib import Path

import pytest

import aerojax

SOURCE = Path(__file__).resolve().parents[1] / "docs" / "make_api.py"


@pytest.fixture(scope="module")
def maker():
    spec = importlib.util.spec_from_file_location("make_api", SOURCE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


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
