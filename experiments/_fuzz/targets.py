"""Every format that a user may have from elsewhere, with its reader."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import yaml

from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_frames
from aerojax.capture.imports.calibration.base import CalibrationConfig
from aerojax.capture.imports.calibration.colmap import ColmapConfig
from aerojax.capture.imports.calibration.drone_tracking import DroneTrackingConfig
from aerojax.capture.imports.calibration.kalibr import KalibrConfig
from aerojax.capture.imports.calibration.nerfstudio import NerfstudioConfig
from aerojax.capture.imports.calibration.opencv import OpencvConfig
from aerojax.capture.imports.calibration.projections import ProjectionsConfig
from aerojax.classify.load import load_classifier
from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError
from aerojax.core.torch_files import read_state_dict
from aerojax.data.clips import load_clip
from aerojax.data.manifest import read_manifest
from aerojax.evaluate.fuzz.workers import Target
from aerojax.gaussians.io.ply import read_placed_ply
from aerojax.gaussians.io.usd_reading import read_placed_usd
from aerojax.pipeline.config import PipelineConfig
from aerojax.simulate.assets.importers.gltf import load_gltf
from aerojax.simulate.assets.importers.mesh_files import load_mesh_file
from aerojax.simulate.assets.importers.models import read_models
from aerojax.simulate.assets.importers.obj import load_wavefront
from aerojax.simulate.assets.importers.usd import open_source
from experiments._fuzz import calibrations, inputs

CONFIG = b"segment: {name: given}\nreconstruct: {name: hull, grid: 32}\ncrop_size: 64\n"


def read_only_file(folder: Path, *, read: Callable[..., object], suffixes: tuple[str, ...], **options: Any) -> None:
    """Read the one file with such an end."""
    read(next(path for path in sorted(folder.iterdir()) if path.suffix in suffixes), **options)


def only_file(read: Callable[..., object], *suffixes: str, **options: Any) -> Callable[[Path], object]:
    """`read_only_file` of one reader; picklable."""
    return functools.partial(read_only_file, read=read, suffixes=suffixes, **options)


def read_whole_capture(folder: Path) -> None:
    """Validate, and decode every frame."""
    capture = read_capture(folder)
    for frame in range(min(capture.frames, inputs.FRAMES)):
        read_frames(capture, frame)


def read_calibration(folder: Path, *, config: CalibrationConfig, name: str = "") -> None:
    """Every camera of a calibration."""
    config.read(folder / name)


def calibration(config: CalibrationConfig, name: str = "") -> Callable[[Path], object]:
    """`read_calibration` of one member; picklable."""
    return functools.partial(read_calibration, config=config, name=name)


def read_config(path: Path) -> object:
    """A configuration in YAML, converted strictly."""
    try:
        values: Any = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise UserError("unreadable", f"{path}: no YAML ({type(error).__name__})", "correct it") from None
    if not isinstance(values, dict):
        raise UserError("invalid", f"{path}: no mapping", "correct it")
    return to_dataclass(values, PipelineConfig, source=str(path))


TARGETS: dict[str, Callable[[], Target]] = {
    "ply": lambda: Target(inputs.splat_plys(), only_file(read_placed_ply, ".ply"), 4.0),
    "compressed_ply": lambda: Target(inputs.compressed_plys(), only_file(read_placed_ply, ".ply"), 3.0),
    "usd_splats": lambda: Target(inputs.splat_stages(), only_file(read_placed_usd, ".usda", ".usdc"), 0.3),
    "safetensors": lambda: Target(({"a.safetensors": inputs.weights()},), only_file(load_classifier, ".safetensors")),
    "pt": lambda: Target(({"a.pt": inputs.torch_archive()},), only_file(read_state_dict, ".pt"), 4.0),
    "clip": lambda: Target(({"a.npz": inputs.clip()},), only_file(load_clip, ".npz"), 3.0),
    "manifest": lambda: Target(({"dataset.json": inputs.manifest()},), read_manifest, 3.0),
    "config": lambda: Target(({"a.yaml": CONFIG},), only_file(read_config, ".yaml"), 3.0),
    "models": lambda: Target((inputs.models(),), only_file(read_models, ".yaml"), 3.0),
    "capture": lambda: Target((inputs.capture(".png"), inputs.capture(".jpg")), read_whole_capture, 3.0),
    "truth": lambda: Target((inputs.capture(".png", truth=True),), read_whole_capture, 2.0),
    "video": lambda: Target((inputs.capture(".png", video=True),), read_whole_capture, 0.5),
    "colmap": lambda: Target(
        (calibrations.colmap_text(), calibrations.colmap_binary()), calibration(ColmapConfig()), 2.0
    ),
    "nerfstudio": lambda: Target((calibrations.nerfstudio(),), calibration(NerfstudioConfig()), 1.0),
    "opencv": lambda: Target((calibrations.opencv(),), calibration(OpencvConfig()), 2.0),
    "kalibr": lambda: Target((calibrations.kalibr(),), calibration(KalibrConfig()), 1.0),
    "projections": lambda: Target((calibrations.projections(),), calibration(ProjectionsConfig()), 1.0),
    "drone_tracking": lambda: Target(
        (calibrations.drone_tracking(),), calibration(DroneTrackingConfig(delay_s=0.0), "config.json"), 1.0
    ),
    "gltf": lambda: Target(
        (inputs.gltf(), inputs.glb()), only_file(load_gltf, ".gltf", ".glb", animation="first"), 3.0
    ),
    "mesh": lambda: Target(inputs.meshes(), only_file(load_mesh_file, ".stl", ".ply"), 2.0),
    "obj": lambda: Target((inputs.wavefront(),), only_file(load_wavefront, ".obj"), 3.0),
    "usd": lambda: Target((inputs.stage(),), only_file(open_source, ".usda", animation="first", speed=1.0), 0.3),
}
"""Targets by the name of their format; inputs are made when they are asked for.

USD's are drawn seldom, since a process starts for each."""


def make_targets(names: Iterable[str]) -> dict[str, Target]:
    """The targets of these formats."""
    return {name: TARGETS[name]() for name in names}
