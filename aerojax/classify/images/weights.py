"""Trained detectors on disk: safetensors with their configuration in the header."""

from __future__ import annotations

import json
from pathlib import Path

import jax

from aerojax.classify.images.detector import Detector, DetectorConfig
from aerojax.core.config import to_dataclass, to_mapping
from aerojax.core.errors import UserError
from aerojax.core.tensors import filled, read_tensors, write_tensors

KEY = "detector"


def save_detector(path: Path, detector: Detector, config: DetectorConfig) -> None:
    """Write a detector's parameters and what it is made of; the file is complete or absent."""
    write_tensors(path, detector, {KEY: json.dumps(to_mapping(config))})


def load_detector(path: Path) -> tuple[Detector, DetectorConfig]:
    """Read what `save_detector` wrote.

    Raises:
        UserError: the file is absent, broken, or holds no detector.
    """
    tensors, header = read_tensors(path)
    try:
        values = json.loads(header[KEY])
    except (KeyError, ValueError):
        raise UserError("missing", f"{path} holds no detector", "give weights of experiments.train_detector") from None
    config = to_dataclass(values, DetectorConfig, source=f"the header of {path}")
    shapes = jax.eval_shape(lambda key: Detector(config, key=key), jax.random.key(0))
    return filled(shapes, tensors, path, whose="its own header"), config
