"""Tables of families: every mistake is named, draws keep to their ranges, and what is drawn stays what it was."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.core.files import json_text, sha256_of_text
from aerojax.simulate.assets.airplanes.families import airplane_families, draw_airplane
from aerojax.simulate.assets.birds.families import bird_families, draw_bird
from aerojax.simulate.assets.families import draw, names_by_split, read_families
from aerojax.simulate.assets.helicopters.families import draw_helicopter, helicopter_families
from aerojax.simulate.assets.multicopters.families import draw_multicopter, multicopter_families

CLASSES = {
    "bird": (bird_families, draw_bird),
    "drone": (multicopter_families, draw_multicopter),
    "airplane": (airplane_families, draw_airplane),
    "helicopter": (helicopter_families, draw_helicopter),
}


@dataclass(frozen=True)
class Kite:
    """A small schema with a field of every type."""

    length: float
    tails: int
    shape: Literal["delta", "box"]
    name: str = "kite"
    sharp: bool = False


SHARED = """
[common]
length = [0.5, 1.5]
tails = 2
shape = "delta"

[long]
extends = "common"
length = [2.0, 3.0]
"""


def _read(folder: Path, train: str, shared: str = SHARED, val: str = "", test: str = ""):
    for name, text in {"shared": shared, "train": train, "val": val, "test": test}.items():
        (folder / f"families_{name}.toml").write_text(text)
    return read_families(folder, (Kite,))


def test_families_inherit_and_keep_their_order(tmp_path):
    train = """
    [second]
    extends = "long"
    shape = { one_of = ["box", "box", "delta"] }
    [first]
    extends = "common"
    tails = [1, 3]
    sharp = true
    """
    found = _read(tmp_path, train, test='[third]\nextends = "long"')
    assert names_by_split(found) == {"train": ("second", "first"), "val": (), "test": ("third",)}
    assert found["second"].ranges == {"length": (2.0, 3.0), "tails": 2, "shape": ["box", "box", "delta"]}
    assert found["first"].ranges == {"length": (0.5, 1.5), "tails": (1, 3), "shape": "delta", "sharp": True}
    assert found["third"].split == "test"


def test_every_mistake_is_named_with_file_family_and_field(tmp_path):
    train = """
    loose = 3
    [a]
    extends = "commn"
    length = 1.0
    [b]
    extends = "common"
    lenght = 1.0
    length = [2.0, 1.0]
    tails = 2.0
    shape = "round"
    sharp = 1
    [c]
    extends = "common"
    length = [1.0, 2.0, 3.0]
    tails = { one_of = [1, 2.0] }
    shape = { one_of = [] }
    name = ["a", "b"]
    [d]
    extends = "common"
    length = 2
    tails = { any_of = [1] }
    """
    with pytest.raises(UserError) as caught:
        _read(tmp_path, train, val='[d]\nextends = "common"\nlength = nan')
    expected = [
        "families_train.toml: loose is no table; write [loose] and its fields below",
        "families_train.toml: a.extends is 'commn'; use one of common, long",
        "families_train.toml: a.tails is missing",
        "families_train.toml: a.shape is missing",
        "families_train.toml: b.lenght is no parameter; use length, tails, shape, name, sharp",
        "families_train.toml: b.length is [2.0, 1.0]; a range is [low, high] of float",
        "families_train.toml: b.tails is 2.0; expected int",
        "families_train.toml: b.shape is 'round'; expected 'delta' or 'box'",
        "families_train.toml: b.sharp is 1; expected bool",
        "families_train.toml: c.length is [1.0, 2.0, 3.0]; a range is [low, high] of float",
        "families_train.toml: c.tails is {'one_of': [1, 2.0]}; a choice is { one_of = [...] } of int",
        "families_train.toml: c.shape is {'one_of': []}; a choice is { one_of = [...] } of 'delta' or 'box'",
        "families_train.toml: c.name is ['a', 'b']; a range is [low, high] of str",
        "families_train.toml: d.length is 2; expected float",
        "families_train.toml: d.tails is {'any_of': [1]}; a choice is { one_of = [...] } of int",
        "families_val.toml: d.length is nan; expected float",
        "families_val.toml: d is a family of train already",
    ]
    lines = [line.strip() for line in str(caught.value).splitlines()[1:]]
    assert sorted(lines) == sorted(expected)
    assert caught.value.code == "invalid"


def test_a_range_that_families_share_is_checked_too(tmp_path):
    with pytest.raises(UserError, match=r"families_shared\.toml: common\.tails is 'two'; expected int"):
        _read(tmp_path, "", SHARED.replace("tails = 2", 'tails = "two"'))


def test_missing_and_unreadable_files_are_named(tmp_path):
    with pytest.raises(UserError, match=r"families_shared\.toml does not exist") as caught:
        read_families(tmp_path, (Kite,))
    assert caught.value.code == "missing"
    with pytest.raises(UserError, match=r"families_train\.toml is not readable TOML") as caught:
        _read(tmp_path, "[a")
    assert caught.value.code == "unreadable"


def test_fields_that_are_computed_may_not_be_given(tmp_path):
    _read(tmp_path, '[a]\nextends = "common"')
    with pytest.raises(UserError, match=r"common\.tails is no parameter"):
        read_families(tmp_path, (Kite,), derived=("tails",))


def test_draws_follow_the_order_of_the_class():
    ranges = {"length": (0.0, 1.0), "tails": (1, 4), "shape": ["delta", "box"]}
    turned = dict(reversed(ranges.items()))
    for seed in range(10):
        kite = draw(Kite, ranges, np.random.default_rng(seed))
        assert kite == draw(Kite, turned, np.random.default_rng(seed))
        rng = np.random.default_rng(seed)
        assert kite == Kite(rng.uniform(0.0, 1.0), int(rng.integers(1, 5)), ("delta", "box")[rng.integers(2)])


def test_draws_keep_to_their_ranges():
    drawn = [draw_multicopter("racing_quad", np.random.default_rng(s)) for s in range(30)]
    low, high = multicopter_families()["racing_quad"].ranges["nose_angle"]
    angles = [p.nose_angle for p in drawn]
    assert low <= min(angles) and max(angles) <= high and np.ptp(angles) > 0.6 * (high - low)
    assert {p.blades for p in drawn} == {2, 3}


def _rounded(tree):
    """Floats to nine digits after the point: powers may differ in the last one between machines."""
    if isinstance(tree, dict):
        return {key: _rounded(value) for key, value in tree.items()}
    return round(tree, 9) if isinstance(tree, float) else tree


@pytest.mark.parametrize(
    ("label", "digest"),
    [
        ("bird", "60d148f806a39059878f73cf01eee5b0b599daa7948b37e6382978b7ca724ed1"),
        ("drone", "9adc89f2f3242bba84324418b268452cb5ce5ddfc946b784e332b5b57bb9e7fc"),
        ("airplane", "b165a8a319ae18904c20d1579f1450996e8c300f0b92d515691254a0ab18946f"),
        ("helicopter", "0a70440b3d320cc29fc78061f5189c4460b8d78bb1d3aa7994793d93500e5e95"),
    ],
)
def test_parameters_of_all_families_are_what_they_were(label, digest):
    """SHA-256 of eight draws of every family, as they were when the tables were Python: data sets stay the same."""
    families, draw_one = CLASSES[label]
    drawn = {
        name: [_rounded(dataclasses.asdict(draw_one(name, np.random.default_rng(seed)))) for seed in range(8)]
        for name in families()
    }
    assert sha256_of_text(json_text(drawn)) == digest
