"""Palettes: many, within their range, and blind to the class."""

from __future__ import annotations

import numpy as np

from aerojax.core.seeds import seed_of
from aerojax.core.types import CLASSES
from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.assets.paint.palette import SCHEMES, SLOTS, draw_palette


def test_palettes_are_many_and_within_range():
    palettes = [draw_palette(seed) for seed in range(300)]
    srgb = np.stack([p.srgb for p in palettes])
    assert srgb.shape == (300, SLOTS, 3) and srgb.min() >= 0.02 and srgb.max() <= 0.97
    assert len(np.unique(srgb[:, 0], axis=0)) > 290
    assert all(len(set(colours)) == len(colours) > SLOTS for colours in SCHEMES.values())


def test_colours_do_not_tell_the_class():
    """Means of the palettes differ between classes by no more than chance (4 standard errors)."""
    means = {}
    for label in CLASSES:
        seeds = [i.seed for i in identities("train", 200) if i.label == label]
        means[label] = np.stack([draw_palette(seed_of("colours", s)).srgb[0] for s in seeds])
    pooled = np.concatenate(list(means.values()))
    for values in means.values():
        assert np.abs(values.mean(0) - pooled.mean(0)).max() < 4 * pooled.std(0).max() / np.sqrt(len(values))
    assert pooled.min() >= 0 and pooled.max() <= 1 and pooled.std(0).min() > 0.15
