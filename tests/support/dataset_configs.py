"""Configurations of data sets as the command line gives them."""

from __future__ import annotations

from pathlib import Path

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from omegaconf import OmegaConf

from aerojax.core.config import to_dataclass
from aerojax.simulate.plan.dataset import DatasetConfig
from experiments.generate_dataset import Config, plain

CONF = Path(__file__).resolve().parents[2] / "conf"


def config_of(*overrides: str) -> DatasetConfig:
    """That of `python -m experiments.generate_dataset` with overrides."""
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(CONF), version_base="1.3"):
        values = OmegaConf.to_container(compose("generate_dataset", list(overrides)), resolve=True)
    return plain(to_dataclass(values, Config))  # type: ignore[arg-type]
