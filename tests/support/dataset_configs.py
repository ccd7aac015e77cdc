"""Configurations of data sets as the command line gives them."""

from __future__ import annotations

from aerojax.core.config import part_of, to_dataclass
from aerojax.simulate.plan.dataset import DatasetConfig
from experiments._launch.composition import composed
from experiments.generate_dataset import Config


def config_of(*overrides: str) -> DatasetConfig:
    """That of `python -m experiments.generate_dataset` with overrides."""
    return part_of(to_dataclass(composed("generate_dataset", Config, *overrides), Config), DatasetConfig)
