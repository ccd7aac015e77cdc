"""What a data set consists of: its configuration, and the list of sequences that follows from it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.splits import SPLITS
from aerojax.simulate.assets.catalogue import Identity, identities
from aerojax.simulate.assets.importers.identities import imported_identities
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.surface import SurfaceConfig
from aerojax.simulate.world.fixed_rigs import FixedRigConfig, conditions
from aerojax.simulate.world.flight import Motion
from aerojax.simulate.world.landscape import LandscapeConfig
from aerojax.simulate.world.random_rigs import RandomRigConfig
from aerojax.simulate.world.rigs import Volume
from aerojax.simulate.world.sensor import SensorConfig


@dataclass(frozen=True)
class RigConfig:
    """A camera rig and what happens in front of it.

    name: begins the name of every sequence.
    fixed: cameras at fixed places; None draws one of `random` for each sequence.
    random: rigs to draw from, where there is no fixed one.
    motion: `flight`, or `in_place` as in the published Sim-1.
    volume: the monitored box, in which all of every path stays.
    max_travel: metres that a path may span.
    max_acceleration: m/s² that a path may reach; 0 allows any, also tens of g where a drone sways widely and fast.
    min_cameras: how many cameras at least see an object in every frame, obstacles aside.
    environment: a white dome, one sky colour a camera, or a landscape under a moving sun.
    landscape: what stands in it; sky, sun and weather are drawn for each sequence.
    sun_rate: degrees a second by which the sun's azimuth moves (the real one: 0.004).
    sun_climb: degrees a second by which the sun rises or sinks at most, drawn for each sequence.
    sites: different landscapes that the sequences share, each with its own days; 0 gives every sequence its own.
    """

    name: str
    fixed: FixedRigConfig | None = None
    random: tuple[RandomRigConfig, ...] = ()
    motion: Motion = "flight"
    volume: Volume = field(default_factory=Volume)
    max_travel: float = 40.0
    max_acceleration: float = 0.0
    min_cameras: int = 3
    environment: Literal["white", "sky", "outdoor"] = "white"
    landscape: LandscapeConfig = field(default_factory=LandscapeConfig)
    sun_rate: float = 0.1
    sun_climb: float = 0.0
    sites: int = 0


@dataclass(frozen=True)
class CrowdConfig:
    """Who flies.

    objects: in every sequence; beyond the first, others of the same split.
    most_objects: draws how many for each sequence, from `objects` to this; 0 has `objects` in every one.
    birds: further birds of the same split that distract.
    crossings: of all beyond the first, the first so many pass another one at 2 to 3 m, in the middle of the sequence.
    occlusions: so many after them pass behind another one, as one of the cameras sees it.
    per_family: individuals of every family.
    """

    objects: int = 1
    most_objects: int = 0
    birds: int = 0
    crossings: int = 0
    occlusions: int = 0
    per_family: int = 1

    @property
    def most(self) -> int:
        """Objects of a sequence at most, birds included."""
        return max(self.objects, self.most_objects) + self.birds


@dataclass(frozen=True)
class FaultConfig:
    """How wrong the written calibration is, and how unequal the clocks are; the truth of both is kept in dataset.json.

    rotation_deg, position_m, focal_percent: standard deviations a camera, of the angle, of each axis, of the focal
        length.
    time_offset_s: largest offset of a camera's clock; the written one is exact.
    """

    rotation_deg: float = 0.0
    position_m: float = 0.0
    focal_percent: float = 0.0
    time_offset_s: float = 0.0


@dataclass(frozen=True, kw_only=True)
class DatasetConfig:
    """What decides the bytes of a data set's sequences.

    seed: of everything.
    rig: cameras, motion and environment.
    frames, fps: of a sequence.
    radii: of the fixed rig, only these; empty takes all.
    sequences: by split, for each identity and condition of the rig.
    images: kinds and quality.
    surface: Gaussians that are written of every object and frame besides.
    classes: only these; empty takes all four.
    identities_per_class: only the first so many of each class and split, for trials; 0 takes all.
    models: list of the user's own models, which are added; None without.
    sensor: of every camera.
    crowd: objects that fly together. faults: errors of calibration and clocks.
    randomisation: 0 for none to 1 for cheap cameras and unusual light, drawn for each camera and sequence.
    """

    seed: int = 0
    rig: RigConfig
    frames: int = 10
    fps: float = 30.0
    sequences: dict[str, int] = field(default_factory=lambda: {"train": 1, "val": 1, "test": 1})
    images: ImageConfig = field(default_factory=lambda: ImageConfig(normals=True, flow=True))
    radii: tuple[float, ...] = ()
    crowd: CrowdConfig = field(default_factory=CrowdConfig)
    faults: FaultConfig = field(default_factory=FaultConfig)
    classes: tuple[str, ...] = ()
    identities_per_class: int = 0
    models: Path | None = None
    sensor: SensorConfig = field(default_factory=SensorConfig)
    randomisation: float = 0.0
    surface: SurfaceConfig = field(default_factory=SurfaceConfig)


@dataclass(frozen=True)
class SequenceTask:
    """One sequence to make: `folder` is its place in the data set, `condition` an index into the rig's conditions."""

    name: str
    identity: Identity
    condition: int
    repeat: int

    @property
    def folder(self) -> str:
        """Relative to the data set."""
        return f"{self.identity.split}/{self.name}"


def fixed_rig(config: DatasetConfig) -> FixedRigConfig | None:
    """The rig's fixed cameras with the radii that the data set takes; None where rigs are drawn."""
    fixed = config.rig.fixed
    return dataclasses.replace(fixed, radii=config.radii) if fixed is not None and config.radii else fixed


def identities_by_split(config: DatasetConfig) -> dict[str, tuple[Identity, ...]]:
    """By split, the identities of the data set: the catalogue's, and the user's own models behind them."""
    own = imported_identities(config.models) if config.models is not None else ()
    found: dict[str, tuple[Identity, ...]] = {}
    for split in SPLITS:
        everyone = (*identities(split, per_family=config.crowd.per_family), *(i for i in own if i.split == split))
        found[split] = tuple(i for i in everyone if not config.classes or i.label in config.classes)
        if config.identities_per_class:
            found[split] = _first_of_each(found[split], config.identities_per_class)
    return found


def _first_of_each(everyone: tuple[Identity, ...], count: int) -> tuple[Identity, ...]:
    counts: dict[str, int] = {}
    kept = []
    for identity in everyone:
        counts[identity.label] = counts.get(identity.label, 0) + 1
        if counts[identity.label] <= count:
            kept.append(identity)
    return tuple(kept)


def work_list(config: DatasetConfig) -> tuple[SequenceTask, ...]:
    """Every sequence of the data set, in an order that holds early all classes.

    Raises:
        UserError: a number makes no sense; the message names the key.
    """
    _check(config)
    fixed = fixed_rig(config)
    names = [c.name for c in conditions(fixed)] if fixed is not None else [""]
    tasks = []
    for split, everyone in identities_by_split(config).items():
        for repeat in range(config.sequences.get(split, 0)):
            for index, condition in enumerate(names):
                for identity in everyone:
                    parts = (config.rig.name, identity.name, condition, f"{repeat:02d}")
                    tasks.append(SequenceTask("_".join(p for p in parts if p), identity, index, repeat))
    if not tasks:
        raise UserError("invalid", "sequences: the data set would be empty", "set sequences.test=1 or another split")
    return tuple(tasks)


def _check(config: DatasetConfig) -> None:
    """Refuse numbers that make no sense.

    Raises:
        UserError: names the key, its value and a remedy.
    """
    rig, crowd, faults = config.rig, config.crowd, config.faults
    wrong = [
        (set(config.sequences) - set(SPLITS), f"sequences has {sorted(config.sequences)}; use {', '.join(SPLITS)}"),
        (min(config.sequences.values(), default=0) < 0, "sequences is negative; use 0 to leave a split out"),
        (config.frames < 1, f"frames is {config.frames}; a sequence needs at least 1"),
        (config.fps <= 0, f"fps is {config.fps:g}; it must be positive"),
        (config.images.samples < 1, f"images.samples is {config.images.samples}; use 1 or more"),
        (config.images.rays_across < 0, f"images.rays_across is {config.images.rays_across}; use 0 or more"),
        (rig.fixed is None and not rig.random, f"rig {rig.name} has neither a fixed rig nor random ones; give one"),
        (set(config.classes) - set(CLASSES), f"classes has {list(config.classes)}; use {', '.join(CLASSES)}"),
        (rig.max_acceleration < 0, f"rig.max_acceleration is {rig.max_acceleration:g}; use 0 for any"),
        (rig.sun_climb < 0, f"rig.sun_climb is {rig.sun_climb:g}; use 0 for a sun of one height"),
        (crowd.objects < 1, f"crowd.objects is {crowd.objects}; at least one object flies"),
        (crowd.birds < 0, f"crowd.birds is {crowd.birds}; use 0 for none"),
        (
            0 != crowd.most_objects < crowd.objects,
            f"crowd.most_objects is {crowd.most_objects}; use crowd.objects or more, or 0",
        ),
        (
            min(crowd.crossings, crowd.occlusions) < 0 or crowd.crossings + crowd.occlusions > crowd.most - 1,
            f"crowd.crossings and crowd.occlusions are {crowd.crossings} and {crowd.occlusions}; "
            f"use 0 to {crowd.most - 1} together",
        ),
        (crowd.per_family < 1, f"crowd.per_family is {crowd.per_family}; use 1 or more"),
        (config.identities_per_class < 0, f"identities_per_class is {config.identities_per_class}; use 0 for all"),
        (not 0 <= config.randomisation <= 1, f"randomisation is {config.randomisation:g}; use 0 (none) to 1"),
        (min(dataclasses.astuple(faults)) < 0, "faults has a negative size; use 0 for none"),
        (
            config.radii and (rig.fixed is None or not set(config.radii) <= set(rig.fixed.radii)),
            f"radii is {list(config.radii)}; choose among {list(rig.fixed.radii) if rig.fixed else []} of the rig",
        ),
    ]
    for fault, message in wrong:
        if fault:
            raise UserError("invalid", message)


@dataclass(frozen=True)
class Counts:
    """How much a work list is: distinct identities, sequences, frames (moments), images (frames of all cameras)."""

    identities: int
    sequences: int
    frames: int
    images: int


def count(config: DatasetConfig, tasks: tuple[SequenceTask, ...]) -> Counts:
    """Counts of a work list; images count one a camera and frame, whatever their kinds."""
    frames = len(tasks) * config.frames
    fixed = config.rig.fixed
    cameras = fixed.cameras if fixed is not None else max(rig.cameras for rig in config.rig.random)
    return Counts(len({task.identity.name for task in tasks}), len(tasks), frames, frames * cameras)
