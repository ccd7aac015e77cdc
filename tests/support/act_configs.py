"""Every act with its presets, what it takes, and its composed configuration."""

from __future__ import annotations

import importlib
import typing
from typing import Any

from experiments._launch.composition import CONF_DIR, composed

NAMES = sorted(p.stem for p in CONF_DIR.glob("*.yaml") if p.stem != "base")
REQUIRED = {
    "calibrate": ("videos=videos",),
    "classify_archive": ("captures=[captures]",),
    "classify_folder": ("captures=captures",),
    "fit_familiarity": ("weights=weights.safetensors",),
    "fit_gaussians": ("capture=capture",),
    "export_dataset": ("dataset=dataset", "format=[coco,yolo]", "out=out"),
    "import_cameras": ("source=source", "out=out"),
    "import_checkpoint": ("checkpoint=a.pt", "out=a.safetensors"),
    "import_clips": ("source=source", "out=out"),
    "import_models": ("models=models.yaml",),
    "import_modelsplat": ("source=source", "out=out"),
    "import_msr_action": ("source=source", "out=out"),
    "import_reconstructor": ("checkpoint=a.pt", "out=a.safetensors"),
    "import_replicator": ("recording=recording", "out=out", "fps=30"),
    "serve": ("capture=capture",),
    "track": ("source=source",),
}
"""Values without a default, by act."""
NEEDED = {"preset=published": ("classify=mambasplat",)}
"""What a preset can only be given with, as its file says: Hydra lets no preset choose a group."""
PRESETS = {
    name: ("smoke", "small", "full") + (("published",) if (CONF_DIR / name / "published.yaml").is_file() else ())
    for name in NAMES
}
"""Presets by act."""


def config_of(name: str) -> type:
    """What an act's `main` takes."""
    main = importlib.import_module(f"experiments.{name}").main
    return typing.get_type_hints(main.__wrapped__)["config"]


def values_of(name: str, *overrides: str) -> dict[str, Any]:
    """The composed configuration of an act, with the values that it requires."""
    needed = (*REQUIRED.get(name, ()), *(more for one in overrides for more in NEEDED.get(one, ())))
    return composed(name, config_of(name), *needed, *overrides)
