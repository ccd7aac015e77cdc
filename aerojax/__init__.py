"""aerojax: flying objects from calibrated camera networks as 4D Gaussians, classified rotation-invariantly.

The names below are the public interface; docs/api.md describes them. Each is imported when it is first used, so that
`import aerojax` loads neither JAX nor Warp.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from aerojax.capture.format import Capture, CaptureCamera, read_capture, rotate_world
    from aerojax.capture.frames import read_frames
    from aerojax.classify.familiarity import load_familiarity
    from aerojax.classify.load import load_classifier, save_classifier
    from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
    from aerojax.classify.mambasplat.model import MambaSplat
    from aerojax.core.errors import UserError
    from aerojax.core.types import CLASSES, Camera, FrameSet, Gaussians, Observation, Silhouette, Track, View
    from aerojax.gaussians.decimate import DecimationConfig, decimate
    from aerojax.gaussians.io.ply import read_placed_ply, read_ply, write_ply
    from aerojax.gaussians.io.usd import write_usd
    from aerojax.gaussians.io.usd_reading import read_placed_usd, read_usd
    from aerojax.gaussians.render import Rendering, render
    from aerojax.gaussians.rotate import covariance, rotate, transform
    from aerojax.geometry.cameras import look_at, project_points, unproject_depth
    from aerojax.geometry.rotations import haar_rotation, quaternion_from_rotation, rotation_from_quaternion
    from aerojax.pipeline.config import PipelineConfig
    from aerojax.pipeline.offline import Clip, reconstruct_capture
    from aerojax.pipeline.step import Pipeline, make_pipeline
    from aerojax.pipeline.stream import stream
    from aerojax.reconstruct.hull import HullConfig, visual_hull

__version__ = "0.1.0"

_HOMES = {
    "aerojax.capture.format": ("Capture", "CaptureCamera", "read_capture", "rotate_world"),
    "aerojax.capture.frames": ("read_frames",),
    "aerojax.classify.familiarity": ("load_familiarity",),
    "aerojax.classify.load": ("load_classifier", "save_classifier"),
    "aerojax.classify.mambasplat.config": ("MambaSplatConfig", "published_config"),
    "aerojax.classify.mambasplat.model": ("MambaSplat",),
    "aerojax.core.errors": ("UserError",),
    "aerojax.core.types": ("CLASSES", "Camera", "FrameSet", "Gaussians", "Observation", "Silhouette", "Track", "View"),
    "aerojax.gaussians.decimate": ("DecimationConfig", "decimate"),
    "aerojax.gaussians.io.ply": ("read_placed_ply", "read_ply", "write_ply"),
    "aerojax.gaussians.io.usd": ("write_usd",),
    "aerojax.gaussians.io.usd_reading": ("read_placed_usd", "read_usd"),
    "aerojax.gaussians.render": ("Rendering", "render"),
    "aerojax.gaussians.rotate": ("covariance", "rotate", "transform"),
    "aerojax.geometry.cameras": ("look_at", "project_points", "unproject_depth"),
    "aerojax.geometry.rotations": ("haar_rotation", "quaternion_from_rotation", "rotation_from_quaternion"),
    "aerojax.pipeline.config": ("PipelineConfig",),
    "aerojax.pipeline.offline": ("Clip", "reconstruct_capture"),
    "aerojax.pipeline.step": ("Pipeline", "make_pipeline"),
    "aerojax.pipeline.stream": ("stream",),
    "aerojax.reconstruct.hull": ("HullConfig", "visual_hull"),
}
"""Where each public name is defined; the imports above say the same to type checkers."""

_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = sorted([*_HOME_OF, "__version__"])  # pyrefly: ignore


def __getattr__(name: str) -> Any:
    """Import a public name's module with the first use of the name (PEP 562)."""
    if name not in _HOME_OF:
        raise AttributeError(f"module 'aerojax' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
