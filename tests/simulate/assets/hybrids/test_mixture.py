"""Mixtures draw from training families alone, keep to their words, and cover every parameter that those use."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aerojax.simulate.assets.catalogue import families_of
from aerojax.simulate.assets.families import Family
from aerojax.simulate.assets.hybrids import airplanes, birds, helicopters, multicopters
from aerojax.simulate.assets.hybrids.mixture import Rules, allowed_values, mixed_ranges, training_families, widened

RULES = {
    "bird": birds.RULES,
    "drone": multicopters.RULES,
    "airplane": airplanes.RULES,
    "helicopter": helicopters.RULES,
}
DRAWS = {
    "bird": lambda rng: birds.draw_hybrid_bird(rng).shape,
    "drone": multicopters.draw_hybrid_multicopter,
    "airplane": airplanes.draw_hybrid_airplane,
    "helicopter": helicopters.draw_hybrid_helicopter,
}
each_class = pytest.mark.parametrize("label", RULES)


@each_class
def test_held_out_families_are_no_source(label):
    families = families_of(label)
    spoiled = {name: f if f.split == "train" else Family(name, f.split, {}) for name, f in families.items()}
    alone = training_families(families)
    for seed in range(64):
        drawn = [mixed_ranges(f, RULES[label], np.random.default_rng(seed)) for f in (families, spoiled, alone)]
        assert drawn[0] == drawn[1] == drawn[2]
    assert all(f.split == "train" for f in alone.values()) and len(alone) < len(families)


@each_class
def test_words_are_those_of_training(label):
    families = families_of(label)
    words: dict[str, set] = {}
    for seed in range(400):
        for field, value in dataclasses.asdict(DRAWS[label](np.random.default_rng(seed))).items():
            if isinstance(value, str):
                words.setdefault(field, set()).add(value)
    for field, found in words.items():
        default = "none" if field in ("guard", "payload", "roof", "tail") else "ring" if field == "layout" else None
        allowed = allowed_values(families, field) | {default, "radial" if field == "frame" else default}
        if field == "gear":
            allowed.add("wheels")
        assert found <= allowed, field
        assert len(found) >= min(2, len(allowed_values(families, field))), field


@each_class
def test_groups_hold_every_parameter_of_training_once(label):
    fields = [field for group in RULES[label].groups.values() for field in group]
    used = {field for family in training_families(families_of(label)).values() for field in family.ranges}
    assert len(fields) == len(set(fields))
    assert used <= set(fields)


def test_no_coaxial_machine_has_three_arms():
    """That is a test family."""
    drawn = [multicopters.draw_hybrid_multicopter(np.random.default_rng(seed)) for seed in range(800)]
    assert not any(p.coaxial and p.arms == 3 for p in drawn)
    assert {p.arms for p in drawn} == set(range(3, 9))


def test_a_group_comes_from_one_parent():
    rules = Rules({"one": ("a", "b"), "two": ("c",)}, {"y": ("one",)}, {})
    families = {
        "x": Family("x", "train", {"a": True, "b": "x", "c": "x"}),
        "y": Family("y", "train", {"a": False, "b": "y", "c": "y"}),
        "z": Family("z", "test", {"a": True, "b": "z", "c": "z"}),
    }
    drawn = [mixed_ranges(families, rules, np.random.default_rng(seed)) for seed in range(60)]
    assert {(d["a"], d["b"]) for d in drawn} == {(True, "x"), (False, "y")}
    assert {(d["b"], d["c"]) for d in drawn} == {("x", "x"), ("x", "y"), ("y", "y"), ("y", "x")}


def test_ranges_widen_but_never_across_zero():
    assert widened((1.0, 2.0)) == pytest.approx((0.71, 2.29))
    assert widened((0.0, 1.0))[0] == 0.0
    assert widened((0.1, 1.0))[0] == pytest.approx(0.06)
    assert widened((-1.0, -0.1))[1] == pytest.approx(-0.06)
    assert widened((-1.0, 1.0)) == pytest.approx((-1.4, 1.4))
    assert widened(2.0) == pytest.approx((1.88, 2.12))
    assert widened((1.0, 2.0), (0.9, 1.9)) == (0.9, 1.9)
    for same in (0.0, 3, True, "word", (2, 5), [0.1, 0.2]):
        assert widened(same) == same
