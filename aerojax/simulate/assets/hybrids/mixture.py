"""Mixtures of training families: every group of parameters from one of a few parents, within widened ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerojax.simulate.assets.families import Family, Range, Value

PARENTS = (0.2, 0.45, 0.35)
"""How often an individual has one, two or three parents."""
WIDER, RELATIVE = 0.2, 0.06
"""A range grows at either end by so much of its width and of its middle."""

Groups = Mapping[str, Sequence[str]]
"""Names of groups and the parameters that only fit together from one parent."""


@dataclass(frozen=True)
class Rules:
    """How families of a class mix.

    groups: every parameter that can be drawn, in groups that come from one parent.
    whole: families whose named groups only fit together: all from it if it is the first parent, else none of them.
    limits: bounds of parameters that a widened range must not pass, beyond staying on its side of zero.
    """

    groups: Groups
    whole: Mapping[str, Sequence[str]]
    limits: Mapping[str, tuple[float, float]]


def training_families(families: Mapping[str, Family]) -> dict[str, Family]:
    """The only families that may be parents: a validation or test family would be a kind seen in training."""
    return {name: family for name, family in families.items() if family.split == "train"}


def mixed_ranges(families: Mapping[str, Family], rules: Rules, rng: np.random.Generator) -> dict[str, Range]:
    """Ranges of one individual's parameters.

    Args:
        families: of the class; only those of training are used.
        rules: of the class.
        rng: draws the parents and who gives what.

    Returns:
        By parameter; one that its parent leaves to its default is absent.
    """
    parents = training_families(families)
    count = 1 + int(rng.choice(len(PARENTS), p=PARENTS))
    names = [str(name) for name in rng.choice(sorted(parents), min(count, len(parents)), replace=False)]
    ranges: dict[str, Range] = {}
    for group, fields in rules.groups.items():
        giver = names[0] if group in rules.whole.get(names[0], ()) else _giver(names, group, rules, rng)
        given = parents[giver].ranges
        ranges |= {f: widened(given[f], rules.limits.get(f)) for f in fields if f in given}
    return ranges


def _giver(names: Sequence[str], group: str, rules: Rules, rng: np.random.Generator) -> str:
    """One of the parents that may give a group by itself; the first one always may."""
    able = [name for i, name in enumerate(names) if i == 0 or group not in rules.whole.get(name, ())]
    return able[int(rng.integers(len(able)))]


def widened(given: Range, limits: tuple[float, float] | None = None) -> Range:
    """A range of floats that reaches a little further on either side, never across zero; all else unchanged.

    A single number becomes a range unless it is 0, which says that there is no such part.
    """
    if isinstance(given, list):
        return given
    if isinstance(given, tuple):
        low, high = given
        if not isinstance(low, float):
            return given
    elif isinstance(given, float) and given != 0.0:
        low = high = given
    else:
        return given
    margin = WIDER * (high - low) + RELATIVE * abs(low + high) / 2
    wide_low, wide_high = low - margin, float(high) + margin
    if low >= 0:
        wide_low = max(wide_low, 0.6 * low)
    if high <= 0:
        wide_high = min(wide_high, 0.6 * high)
    if limits is not None:
        wide_low, wide_high = max(wide_low, limits[0]), min(wide_high, limits[1])
    return (min(wide_low, wide_high), wide_high)


def allowed_values(families: Mapping[str, Family], field: str) -> set[Value]:
    """Words and switches that training families give a parameter: no mixture has another."""
    found: set[Value] = set()
    for family in training_families(families).values():
        given = family.ranges.get(field)
        if isinstance(given, list):
            found |= set(given)
        elif given is not None and not isinstance(given, tuple):
            found.add(given)
    return found
