"""How much room a data set will take, estimated before it is made."""

from __future__ import annotations

import numpy as np

from aerojax.simulate.plan.dataset import DatasetConfig, SequenceTask, fixed_rig
from aerojax.simulate.world.fixed_rigs import conditions

_CONSTANT = {"rgb": 1.0, "mask": 0.7, "coverage": 0.35, "normal": 2.0}
"""Bytes of a constant PNG for every 1,000 pixels, by kind: run lengths of 258 bytes in a few bits."""
_EMPTY_TIFF = {"depth": 2.4, "flow": 2.9}
"""Kilobytes of the tables of a TIFF of 2560×1440 pixels."""
_PER_PIXEL = {"rgb": 1.6, "mask": 0.05, "coverage": 0.2, "normal": 3.5, "depth": 3.0, "flow": 6.5}
"""Bytes of a pixel of the object's window, measured on the presets."""
_LANDSCAPE = 2.0
"""Bytes of an RGB pixel outdoors."""
_GAUSSIAN = 17 * 4
"""Bytes of one in a PLY file with degree-0 colour."""
_SPAN = 0.7
"""Area of the window of an object that is 1 m long, in square metres."""


def estimated_bytes(config: DatasetConfig, tasks: tuple[SequenceTask, ...]) -> int:
    """Bytes of all images and Gaussians of a work list, within a factor of two; other files are small beside them."""
    flags = config.images
    kinds = ["rgb", "mask"]
    kinds += [k for k, on in (("depth", flags.depth), ("coverage", flags.coverage), ("normal", flags.normals)) if on]
    kinds += ["flow"] if flags.flow else []
    by_condition: dict[int, float] = {}
    for task in tasks:
        by_condition.setdefault(task.condition, _image_set(config, task.condition, kinds))
    cameras = _cameras(config)
    gaussians = _GAUSSIAN * config.surface.count * _objects(config) * len(tasks) * config.frames
    return round(sum(by_condition[task.condition] for task in tasks) * cameras * config.frames + gaussians)


def _cameras(config: DatasetConfig) -> float:
    fixed = config.rig.fixed
    return float(fixed.cameras) if fixed is not None else float(np.mean([rig.cameras for rig in config.rig.random]))


def _image_set(config: DatasetConfig, condition: int, kinds: list[str]) -> float:
    """Bytes of one camera's files of one frame."""
    pixels, span = _geometry(config, condition)
    window = min(_SPAN * _objects(config) * span**2, pixels)
    total = sum(_PER_PIXEL[kind] * window for kind in kinds)
    total += sum(_CONSTANT[kind] * (pixels - window) / 1000 for kind in kinds if kind in _CONSTANT)
    total += sum(_EMPTY_TIFF[kind] * 1000 * pixels / (2560 * 1440) for kind in kinds if kind in _EMPTY_TIFF)
    return total + (_LANDSCAPE * pixels if config.rig.environment == "outdoor" else 0.0)


def _objects(config: DatasetConfig) -> float:
    """Objects in a sequence, in the mean."""
    crowd = config.crowd
    return (crowd.objects + crowd.birds + crowd.most) / 2


def _geometry(config: DatasetConfig, condition: int) -> tuple[float, float]:
    """Pixels of an image, and pixels that a metre spans at the object's mean distance."""
    fixed = fixed_rig(config)
    if fixed is None:
        rigs = config.rig.random
        return float(np.mean([r.width * r.height for r in rigs])), float(np.mean([np.mean(r.span_px) for r in rigs]))
    radius = conditions(fixed)[condition].radius
    middle = (np.array(config.rig.volume.low) + np.array(config.rig.volume.high)) / 2
    distance = radius or float(np.linalg.norm(middle))
    return float(fixed.width * fixed.height), fixed.focal_px / distance
