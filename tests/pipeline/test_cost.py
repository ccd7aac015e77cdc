"""Costs of members: counted parameters, a time for each way of reading, none for what cannot stream."""

from __future__ import annotations

import jax
import pytest

from aerojax.classify.base import ClassifierConfig, untrained
from aerojax.classify.ensemble.config import EnsembleConfig
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.views.config import ViewsConfig
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.cost import member_cost

SMALL = MambaSplatConfig(depth=1, mamba_layers=1, d_model=16, channels=4)
PIPELINE = PipelineConfig(crop_size=32, decimation=DecimationConfig(keep=32))


@pytest.mark.long
@pytest.mark.parametrize("config", [SMALL, EnsembleConfig(member=SMALL, size=2), ViewsConfig(width=8, d_model=16)])
def test_every_member_has_its_cost(config: ClassifierConfig):
    made = untrained(config, tokens=8, frames=2, key=jax.random.key(0))
    found = member_cost(made, PIPELINE, views=3, repeats=2)
    assert found["parameters"] == sum(leaf.size for leaf in jax.tree.leaves(made.network))
    assert found["step_ms"] > 0 and found["stage_ms"] > 0 and found["clip_ms"] > 0
