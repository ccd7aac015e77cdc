"""A description as JSON."""

from __future__ import annotations

import numpy as np

from aerojax.evaluate.dataset_qa.description import to_json


def test_json_has_no_infinities():
    assert to_json({"a": (np.nan, np.array([1.0, np.inf])), "b": True, "c": "x", 1: 2}) == {
        "a": [None, [1.0, None]],
        "b": True,
        "c": "x",
        "1": 2,
    }
