"""Birds of mixed families: bodies, heads, tails, wings and beats exchanged, made bulkier, with legs let down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerojax.simulate.assets.birds.families import BirdParameters, bird_families
from aerojax.simulate.assets.birds.shape import BirdShape
from aerojax.simulate.assets.birds.wingbeat import WingBeat, wingbeat_hertz
from aerojax.simulate.assets.families import draw
from aerojax.simulate.assets.hybrids.mixture import Rules, mixed_ranges

RULES = Rules(
    groups={
        "body": ("body_length", "body_width", "body_depth", "wing_place"),
        "head": (
            "neck_length", "neck_radius", "neck_rise", "neck_fold", "head_radius", "bill", "bill_length", "bill_radius",
            "crest",
        ),
        "tail": ("tail", "tail_length", "tail_width"),
        "legs": ("legs", "leg_drop"),
        "wing": ("aspect", "hand", "wrist_forward", "tip_sweep", "tip", "fingers", "arch"),
        "beat": (
            "mass", "span", "body_pitch", "rise", "fall", "downstroke", "fold", "lag", "heave", "beats", "stroke_plane",
        ),
        "glide": ("glide_seconds", "glide_angle", "bounding", "glide_flex", "rock"),
    },
    whole={},
    limits={"hand": (0.35, 0.82), "downstroke": (0.4, 0.65), "stroke_plane": (0.0, 70.0), "leg_drop": (0.0, 90.0)},
)  # fmt: skip
BULKY, BULK = 0.2, (1.1, 1.6)
"""How often a bird is bulkier than its families, and by how much."""
TEMPO = (0.75, 1.35)
"""Beats over those of Pennycuick's formula, which living birds scatter about as much (1996, table 1)."""


def draw_hybrid_bird(rng: np.random.Generator) -> BirdParameters:
    """Draw a bird whose groups of parameters come from one to three training families."""
    ranges = mixed_ranges(bird_families(), RULES, rng)
    shape = _bulky(draw(BirdShape, ranges, rng), rng)
    if shape.tip == "slotted" and shape.fingers == 0:
        shape = replace(shape, tip="round")
    hertz = wingbeat_hertz(shape.mass, shape.span, shape.aspect) * float(np.exp(rng.uniform(*np.log(TEMPO))))
    return BirdParameters(shape, draw(WingBeat, {**ranges, "hertz": min(hertz, 14.0)}, rng))


def _bulky(p: BirdShape, rng: np.random.Generator) -> BirdShape:
    """A heavier trunk and head; the neck never wider than the trunk."""
    bulk = float(rng.uniform(*BULK)) if rng.random() < BULKY else 1.0
    width, depth = bulk * p.body_width, bulk * p.body_depth
    return replace(
        p,
        body_width=width,
        body_depth=depth,
        neck_radius=min(p.neck_radius * bulk, 0.42 * width),
        head_radius=min(p.head_radius * bulk, 0.5 * width),
        bill_radius=min(p.bill_radius * bulk, 0.4 * p.head_radius),
    )
