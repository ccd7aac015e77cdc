"""Templates are filled in one pass, and miss nothing."""

from __future__ import annotations

import pytest

from aerojax.view.templates import fill


def test_fill_names_a_missing_part():
    with pytest.raises(KeyError, match="title"):
        fill("<title>[[title]]</title><style>[[style]]</style>", {"style": ""})


def test_parts_are_not_filled_again():
    assert fill("[[a]]-[[b]] [c] [[a]]", {"a": "[[b]]", "b": "2"}) == "[[b]]-2 [c] [[b]]"
