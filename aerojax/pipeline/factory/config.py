"""What a factory draws clips from: ranges, each two numbers; two equal ones fix the value."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from aerojax.core.errors import UserError
from aerojax.data.clips import VIEWS
from aerojax.data.splits import Split
from aerojax.pipeline.config import PipelineConfig
from aerojax.simulate.render.image import ImageConfig

Range = tuple[float, float]
"""Lowest and highest value."""
KINDS = ("sphere", "circle", "line", "free")
"""Layouts of cameras: as Sim-1, Sim-2 and Sim-3 have them, and each camera in a place of its own."""


@dataclass(frozen=True)
class RigRanges:
    """Cameras.

    kinds: layouts, of `KINDS`; equally likely, one named twice is twice as likely.
    cameras: how many, both ends included.
    width_px: pixels that the object's longer side spans, median over the cameras; logarithmic.
    distance_m: from the object to the cameras, median; logarithmic.
    elevation_deg: of the cameras, seen from the object (all but a line).
    line_elevation_deg: of the middle of a line, seen from the object.
    line_half_angle_deg: half the angle under which the object sees a line's length; logarithmic.
    field_deg: horizontal field of view, if the image is not wider than `most_pixels`.
    most_pixels: width of the largest image.
    off_centre: largest share of the half image by which the cameras look past the object.
    roll_deg: largest turn of each camera about its axis.
    level: share of the rigs whose cameras stand upright.
    """

    kinds: tuple[str, ...] = KINDS
    cameras: tuple[int, int] = (3, VIEWS)
    width_px: Range = (12.0, 160.0)
    distance_m: Range = (2.0, 400.0)
    elevation_deg: Range = (-50.0, 60.0)
    line_elevation_deg: Range = (-40.0, 10.0)
    line_half_angle_deg: Range = (3.5, 25.0)
    field_deg: Range = (25.0, 65.0)
    most_pixels: int = 4096
    off_centre: float = 0.5
    roll_deg: Range = (0.0, 180.0)
    level: float = 0.6


@dataclass(frozen=True)
class FlightRanges:
    """Motion.

    in_place: share of the clips whose object holds its place, as in Sim-1.
    max_travel: metres that a path may span; logarithmic. It is also kept within the cameras' field.
    usual_fps, usual: frame rate of that share of the clips.
    fps: range of the others' frame rates; it holds alone where `usual` is 0.
    phase: seconds into the animation.
    """

    in_place: float = 0.3
    max_travel: Range = (1.0, 60.0)
    usual_fps: float = 30.0
    usual: float = 0.7
    fps: Range = (15.0, 60.0)
    phase: Range = (0.0, 10.0)


@dataclass(frozen=True)
class FaultRanges:
    """What is wrong with a clip. A range that holds 0 gives 0 to the share `without` of the clips.

    without: of the clips, one draw a fault.
    rotation_deg, position_m, focal_percent: standard deviations of the stated calibration, as in `FaultConfig`.
    clock_ms: largest offset of a camera's clock that nobody states.
    lost: cameras that record nothing; at least the pipeline's `min_views` are left.
    mask_threshold: least coverage of a mask's pixel.
    mask_growth: pixels by which masks are dilated, eroded where it is negative; whole numbers.
    sensor: strength of blur, exposure, colour balance and noise, 0..1; see `draw_sensor`.
    """

    without: float = 0.5
    rotation_deg: Range = (0.0, 0.3)
    position_m: Range = (0.0, 0.01)
    focal_percent: Range = (0.0, 0.5)
    clock_ms: Range = (0.0, 15.0)
    lost: tuple[int, int] = (0, 1)
    mask_threshold: Range = (0.15, 0.5)
    mask_growth: tuple[int, int] = (-1, 1)
    sensor: Range = (0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class FactoryConfig:
    """What decides the clips of a factory.

    seed: of everything but the individuals themselves.
    catalogue: the classes' families, or things of none of them, in whose clips everything is "unknown".
    split: whose families fly; outliers are those of val and test.
    individuals: of each class, or kind of outlier. clips: of each individual. More of either extend the list and change
        none of it.
    frames: of a clip, at most: unusable ones are left out.
    least_frames: usable frames that a clip needs; else it is drawn anew.
    attempts: draws of one clip before it is given up.
    tokens: Gaussians kept of each frame.
    rigs: layouts of cameras. flights: motion. faults: errors of calibration and clocks.
    images: samples of pixels; its mask threshold is drawn instead.
    pipeline: from images to Gaussians; training sees no frame of two views, of which little can be learnt.
    """

    seed: int = 0
    catalogue: Literal["classes", "outliers"] = "classes"
    split: Split = "train"
    individuals: int = 100
    clips: int = 4
    frames: int = 8
    least_frames: int = 4
    attempts: int = 20
    tokens: int = 512
    rigs: RigRanges = field(default_factory=RigRanges)
    flights: FlightRanges = field(default_factory=FlightRanges)
    faults: FaultRanges = field(default_factory=FaultRanges)
    images: ImageConfig = field(default_factory=lambda: ImageConfig(depth=False, rays_across=256))
    pipeline: PipelineConfig = field(default_factory=lambda: PipelineConfig(min_views=3))

    def __post_init__(self) -> None:
        for group in (self.rigs, self.flights, self.faults):
            _check_ranges(group)
        low, high = self.rigs.cameras
        if low < self.pipeline.min_views or high > VIEWS:
            problem = f"rigs.cameras is {low} to {high}"
            raise UserError("out-of-range", problem, f"use {self.pipeline.min_views} to {VIEWS}")
        if not self.rigs.kinds or set(self.rigs.kinds) - set(KINDS):
            raise UserError("out-of-range", f"rigs.kinds is {list(self.rigs.kinds)}", f"choose of {', '.join(KINDS)}")
        if not 1 <= self.least_frames <= self.frames or min(self.individuals, self.clips, self.attempts) < 1:
            problem = f"frames {self.frames}, least_frames {self.least_frames}, individuals {self.individuals}, "
            problem += f"clips {self.clips}, attempts {self.attempts}"
            raise UserError("invalid", problem, "use 1 or more, and no more least_frames than frames")


def _check_ranges(group: object) -> None:
    for name, value in vars(group).items():
        if isinstance(value, tuple) and not isinstance(value[0], str) and value[0] > value[1]:
            raise UserError("invalid", f"{name} is {value[0]} to {value[1]}", "give the lower number first")


def uniform(rng: np.random.Generator, ends: Range) -> float:
    """A draw between two ends."""
    return float(rng.uniform(*ends))


def log_uniform(rng: np.random.Generator, ends: Range) -> float:
    """A draw between two positive ends whose logarithm is uniform."""
    return float(np.exp(rng.uniform(*np.log(ends))))


def draw_fault(rng: np.random.Generator, ends: Range, without: float) -> float:
    """A draw between two ends, 0 instead with probability `without` where 0 is one of the values."""
    value, none = rng.uniform(*ends), rng.uniform() < without
    return 0.0 if none and ends[0] <= 0.0 <= ends[1] else float(value)


def draw_whole_fault(rng: np.random.Generator, ends: tuple[int, int], without: float) -> int:
    """`draw_fault` among whole numbers, both ends included."""
    value, none = rng.integers(ends[0], ends[1] + 1), rng.uniform() < without
    return 0 if none and ends[0] <= 0 <= ends[1] else int(value)
