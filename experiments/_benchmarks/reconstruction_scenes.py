"""The conditions of eval_reconstructor: which scenes each row is measured on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from aerojax.data.views import ViewSet, stacked
from aerojax.pipeline.factory.config import FaultRanges, RigRanges
from aerojax.pipeline.factory.levels import NO_FAULTS, NO_TURN
from aerojax.pipeline.factory.protocol import ProtocolConfig, protocol_scenes
from aerojax.pipeline.factory.subjects import Subject, model_subjects, test_subjects
from aerojax.pipeline.factory.views import ViewsConfig, objects_of, scenes_of
from experiments._benchmarks.reconstructors import with_masks

DEGENERATE_PX = 16.0
"""An object of fewer pixels is enlarged more than sixfold in a crop of 128: the crop is mostly interpolation, and the
thesis' comparison with such crops says little (§6.4.3). Targets here are sharp, so the figures stay honest."""


@dataclass(frozen=True)
class ConditionsConfig:
    """What is measured; an empty list leaves a sweep out.

    identities: test identities of the protocol. models: folders of model files, each a condition of its own.
    most_models: of each folder, at most; None for all.
    protocol: cameras and images.
    contexts: numbers of context views. masks: changes of the masks, see `with_masks`. swept: identities of those two.
    distances: metres from sphere cameras of one focal length; focal_px: that focal length, so a metre at 32 m spans 80
        pixels as in the published Sim-1. cameras: of these rigs. recorded: test identities before each rig.
    rigs: layouts of cameras around objects. width_px: of these objects, pixels. calibration_deg: errors of the stated
        rotations there.
    """

    identities: int = 26
    models: tuple[Path, ...] = ()
    most_models: int | None = None
    protocol: ProtocolConfig = field(default_factory=ProtocolConfig)
    contexts: tuple[int, ...] = (2, 3, 4, 5, 6, 7, 8)
    masks: tuple[str, ...] = ("none", "grown", "shrunk", "empty")
    swept: int = 8
    distances: tuple[float, ...] = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 100.0, 140.0, 200.0, 280.0)
    focal_px: float = 2560.0
    cameras: int = 4
    recorded: int = 12
    rigs: tuple[str, ...] = ("sphere", "circle", "line", "free")
    width_px: float = 80.0
    calibration_deg: tuple[float, ...] = (0.3,)


@dataclass(frozen=True)
class Condition:
    """One column of a table: scenes and what they vary."""

    factor: str
    value: str
    scenes: Callable[[], ViewSet]
    sheet: bool = False


def conditions(config: ConditionsConfig, assets: Path, *, seed: int) -> Iterator[Condition]:
    """Every condition; scenes are made when they are asked for."""
    protocol, subjects = config.protocol, test_subjects(max(config.identities, config.swept), assets)
    if config.identities:
        yield _looked("protocol", "test identities", subjects[: config.identities], protocol, sheet=True)
    for folder in config.models:
        models = model_subjects(folder, assets, config.most_models)
        yield _looked("protocol", folder.name, models, protocol, sheet=True)
    swept = subjects[: config.swept]
    for count in config.contexts:
        yield _looked("context views", str(count), swept, replace(protocol, contexts=count))
    for change in config.masks:
        yield Condition("masks", change, lambda c=change: with_masks(protocol_scenes(swept, protocol), c))
    around = _rig(config, "sphere", config.cameras)
    for metres in config.distances:
        width = config.focal_px / metres
        rigs = replace(around, distance_m=(metres, metres), width_px=(width, width))
        label = f"{metres:g} m" + (" (degenerate crop)" if width < DEGENERATE_PX else "")
        yield _recorded("distance", label, config, rigs, NO_FAULTS, seed)
    for kind in config.rigs:
        yield _recorded("rig", kind, config, _rig(config, kind, 5), NO_FAULTS, seed)
        for degrees in config.calibration_deg:
            faults = replace(NO_FAULTS, rotation_deg=(degrees, max(degrees, NO_TURN)))
            label = f"{kind} {degrees:g} deg"
            yield _recorded("calibration", label, config, _rig(config, kind, 5), faults, seed)


def _rig(config: ConditionsConfig, kind: str, cameras: int) -> RigRanges:
    width = (config.width_px, config.width_px)
    return RigRanges(kinds=(kind,), cameras=(cameras, cameras), width_px=width, distance_m=(32.0, 32.0))


def _looked(
    factor: str, value: str, subjects: tuple[Subject, ...], protocol: ProtocolConfig, *, sheet: bool = False
) -> Condition:
    return Condition(factor, value, lambda: protocol_scenes(subjects, protocol), sheet)


def _recorded(
    factor: str, value: str, config: ConditionsConfig, rigs: RigRanges, faults: FaultRanges, seed: int
) -> Condition:
    """Test identities as cameras of a rig record them and the pipeline crops them."""
    made = ViewsConfig(
        seed=seed,
        split="test",
        objects=config.recorded,
        solids=0.0,
        poses=1,
        targets=config.protocol.targets,
        near=0.0,
        size=config.protocol.size,
        rigs=rigs,
        faults=faults,
    )
    return Condition(
        factor, value, lambda: stacked([scene for one in objects_of(made) for scene in scenes_of(one, made)])
    )
