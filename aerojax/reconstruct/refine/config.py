"""Configuration of the refined hull."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Literal

from jaxtyping import Array, Key

from aerojax.core.errors import UserError
from aerojax.reconstruct.base import TrainableConfig
from aerojax.reconstruct.hull import HullConfig

if TYPE_CHECKING:
    from aerojax.reconstruct.refine.reconstructor import Refine


@dataclass(frozen=True)
class Bounds:
    """What one update may change of a Gaussian. Pixels are those of the finest view, at the Gaussian.

    shift: of the centre, pixels: so far along its own axes, and as far again along those of the cameras.
    turn: about each of its axes, radians.
    log_scale: of each standard deviation.
    least_scale, most_scale: pixels; no standard deviation is changed to less or more. The first is the 3D smoothing
        filter of Yu et al. 2024 (variance 0.2): finer detail than the finest view samples cannot have been seen.
    logit: of the opacity.
    colour: sRGB.
    """

    shift: float = 2.0
    turn: float = 0.5
    log_scale: float = 0.7
    least_scale: float = 0.45
    most_scale: float = 8.0
    logit: float = 2.0
    colour: float = 0.3


@dataclass(frozen=True)
class RefineConfig(TrainableConfig):
    """A hull and what corrects it.

    grid, capacity, dilation: of the hull that Gaussians start on, as in `HullConfig`; coarser than the hull alone,
        because a Gaussian that can be shaped covers more.
    coverage: least share of a pixel that counts as covered where the hull is cut: a blade or rod seldom fills half of
        one, and updates can take off what is too much.
    image: side of the images that renderings are compared with, pixels; larger crops are averaged.
    updates: render-and-update steps; all have the same parameters.
    neighbours: that a Gaussian exchanges with.
    width: of what is remembered of a Gaussian, and of the layers on it.
    channels: of image features at the image's size, a half and a quarter.
    bounds: of one update.
    """

    adjustable: ClassVar[tuple[str, ...]] = ("updates",)
    reads_known: ClassVar[bool] = True
    name: Literal["refine"] = "refine"
    grid: int = 40
    capacity: int = 1536
    dilation: float = 0.15
    coverage: float = 0.35
    image: int = 64
    updates: int = 2
    neighbours: int = 8
    width: int = 64
    channels: tuple[int, int, int] = (16, 32, 48)
    bounds: Bounds = field(default_factory=Bounds)

    def __post_init__(self) -> None:
        if self.image < 16 or self.image % 4 or min(self.updates, self.neighbours, self.width, *self.channels) < 1:
            sizes = f"image {self.image}, updates {self.updates}, neighbours {self.neighbours}, width {self.width}"
            raise UserError("out-of-range", f"refine: {sizes}", "use 1 or more, and a multiple of 4 from 16 for image")
        if not 0.0 < self.coverage < 1.0:
            raise UserError("out-of-range", f"refine: coverage {self.coverage}", "a share lies between 0 and 1")
        if self.neighbours >= self.capacity:
            problem = f"refine: {self.neighbours} neighbours of {self.capacity} Gaussians"
            raise UserError("out-of-range", problem, "use fewer neighbours or a larger capacity")

    @property
    def hull(self) -> HullConfig:
        """Of the Gaussians before the first update."""
        return HullConfig(grid=self.grid, capacity=self.capacity, dilation=self.dilation)

    def untrained(self, *, key: Key[Array, ""]) -> Refine:
        """The member with random parameters: its answer is the hull."""
        from aerojax.reconstruct.refine.network import RefineNetwork
        from aerojax.reconstruct.refine.reconstructor import Refine

        return Refine(RefineNetwork(self, key=key), self)
