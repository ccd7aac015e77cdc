"""Every experiment's configuration composes and fits its dataclass, in every preset; mistakes are named."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from omegaconf import OmegaConf

from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError

ROOT = Path(__file__).resolve().parents[1]
NAMES = sorted(p.stem for p in (ROOT / "conf").glob("*.yaml") if p.stem != "base")
REQUIRED = {
    "classify_folder": ("captures=captures",),
    "fit_gaussians": ("capture=capture",),
    "export_dataset": ("dataset=dataset", "format=[coco,yolo]", "out=out"),
    "import_checkpoint": ("checkpoint=a.pt", "out=a.safetensors"),
    "import_clips": ("source=source", "out=out"),
    "import_models": ("models=models.yaml",),
    "import_replicator": ("recording=recording", "out=out", "fps=30"),
}


def composed(name: str, *overrides: str) -> dict:
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        return OmegaConf.to_container(compose(name, list(overrides)), resolve=True, throw_on_missing=True)  # type: ignore[return-value]


@pytest.mark.parametrize("preset", ["smoke", "small", "full"])
@pytest.mark.parametrize("name", NAMES)
def test_config_fits(name, preset):
    config_type = importlib.import_module(f"experiments.{name}").Config
    config = to_dataclass(composed(name, f"preset={preset}", *REQUIRED.get(name, ())), config_type)
    assert config.preset == preset


def test_every_experiment_has_a_config():
    sources = [p for p in (ROOT / "experiments").glob("*.py") if p.stem != "launch"]
    acts = {p.stem for p in sources if "\n@experiment(Config" in p.read_text()}
    assert acts == set(NAMES)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"sead": 1}, "sead"),
        ({"seed": "one"}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"seed": True}, "seed"),
        (
            {"pipeline": {"crop_size": 128, "min_views": 3, "hull": {"grid": "big"}, "decimation": {}}},
            "pipeline.hull.grid",
        ),
        ({"pipeline": {"crop_sise": 128}}, "crop_sise"),
    ],
)
def test_mistakes_are_named(change, named):
    from experiments.classify import Config

    with pytest.raises(UserError, match=named):
        to_dataclass({**composed("classify"), **change}, Config)


def test_missing_key_is_named():
    from experiments.classify import Config

    values = composed("classify")
    del values["weights"]
    with pytest.raises(UserError, match="weights"):
        to_dataclass(values, Config)


def test_all_mistakes_at_once():
    from experiments.classify import Config

    with pytest.raises(UserError) as caught:
        to_dataclass({**composed("classify"), "seed": "x", "colour": 3}, Config)
    assert "seed" in str(caught.value) and "colour" in str(caught.value)


def test_paths_do_not_depend_on_the_working_directory():
    from experiments._launch.command import CONF_DIR

    assert CONF_DIR.is_absolute()
