"""Weights under the released names, drawn by the recipe of the classifier's reference data."""

from __future__ import annotations

import json
import zlib
from pathlib import Path

import numpy as np


def draw_tensor(entry: dict) -> np.ndarray:
    """The recipe of the golden README: a seeded normal draw per tensor, scaled by kind, rounded to float32."""
    name, shape, kind = entry["name"], tuple(entry["shape"]), entry["kind"]
    g = np.random.default_rng(zlib.crc32(name.encode())).standard_normal(shape)
    if kind == "fan_in":
        fan = shape[1] if name.endswith("global_pool.weight") else np.prod(shape[1:])
        g = g / np.sqrt(fan)
    elif kind == "A_log":
        g = np.log(np.arange(1, 17)) + 0.05 * g
    else:
        offset, factor = {"gain": (1, 0.1), "bias": (0, 0.1), "dt_bias": (-4.6, 0.5), "zeros": (0, 0)}[kind]
        g = offset + factor * g
    return g.astype(np.float32)


def recipe_tensors(shared: Path, spec: str, dtype: type) -> dict[str, np.ndarray]:
    modes = json.loads((shared / "golden/classifier/state_dict_spec.json").read_text())["modes"]
    return {e["name"]: draw_tensor(e).astype(dtype) for e in modes[spec]["tensors"] if e["kind"] != "buffer_sinusoid"}
