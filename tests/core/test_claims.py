"""A folder belongs to the configuration that its record holds."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from aerojax.core.claims import check_claim, claim, claimed, differing
from aerojax.core.errors import UserError


def test_the_first_claim_stays_and_equal_ones_pass(tmp_path):
    record = tmp_path / "clips/manifest.json"
    assert claimed(record) is None
    values = {"sizes": (1, 2), "folder": Path("here"), "seed": None}
    claim(record, values)
    before = record.read_bytes()
    claim(record, values)
    claim(record, values | {"workers": 3}, ignoring=("workers",))
    assert record.read_bytes() == before
    assert claimed(record) == {"sizes": [1, 2], "folder": "here", "seed": None}


def test_another_configuration_is_refused_by_the_keys_that_differ(tmp_path):
    record = tmp_path / "manifest.json"
    claim(record, {"a": 1, "b": 2, "c": 3})
    with pytest.raises(UserError, match=r"manifest\.json: .* another a, c, d; choose another folder") as error:
        claim(record, {"a": 0, "b": 2, "d": 4})
    assert error.value.code == "occupied" and json.loads(record.read_text())["a"] == 1
    with pytest.raises(UserError, match="another b"):
        check_claim(record, {"a": 1, "b": 3}, {"a": 1, "b": (3,)})
    assert differing({"a": None}, {}) == ["a"] and differing({"a": [1]}, {"a": (1,)}) == []


@pytest.mark.parametrize("content", ["{", "[1]"])
def test_a_damaged_record_is_named(tmp_path, content):
    (tmp_path / "manifest.json").write_text(content)
    with pytest.raises(UserError, match="is not a JSON object") as error:
        claim(tmp_path / "manifest.json", {})
    assert error.value.code == "unreadable"
