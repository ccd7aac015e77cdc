"""The door of stage 2: from views of one object to its 3D Gaussians."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

from jaxtyping import Array, Bool, Int, Key

from aerojax.core.types import Gaussians, View
from aerojax.reconstruct.weights import load_parameters


@runtime_checkable
class Reconstructor(Protocol):
    """A pure function of one frame's crops, fit for `jax.jit` and `jax.vmap`."""

    def __call__(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, Int[Array, ""]]:
        """Gaussians in the frame of the crops' cameras, metres.

        Args:
            views: crops (leading axis `view`) that look at the frame's origin.
            valid: views that count.

        Returns:
            A fixed number of Gaussians, of which the first `count` are real and the rest repeat real ones; `count`, 0
            where the views do not agree on any object.
        """
        ...


@runtime_checkable
class TrainableReconstructor(Reconstructor, Protocol):
    """A reconstructor as training sees it: `jax.grad` with respect to it gives a reconstructor of gradients."""

    @property
    def network(self) -> Any:
        """The pytree that holds every parameter."""
        ...

    def steps(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, ...]:
        """Gaussians after each of the member's updates; the first is where it starts, the last its answer.

        All of one number and in the order of the call. Those that only fill the number up, beyond the call's count,
        have opacity 0, so that the whole can be rendered without the count.

        Args:
            views, valid: as in the call.
        """
        ...


@dataclass(frozen=True)
class ReconstructorConfig(ABC):
    """Configuration of a member, chosen by its name: `reconstruct=hull`."""

    members: ClassVar[str] = "aerojax.reconstruct.members"
    reads_known: ClassVar[bool] = False
    """Whether the member heeds `View.known`; others are given no view that cuts the object."""

    @abstractmethod
    def build(self) -> Reconstructor:
        """The member."""


@dataclass(frozen=True)
class TrainableConfig(ReconstructorConfig):
    """Configuration of a member with parameters: training draws them, `build` reads them.

    adjustable: fields that parameters do not depend on, which may differ from those of training.
    weights: file that `train_reconstructor` wrote; empty takes the one that comes with the package.
    """

    adjustable: ClassVar[tuple[str, ...]] = ()
    weights: str = ""

    @abstractmethod
    def untrained(self, *, key: Key[Array, ""]) -> TrainableReconstructor:
        """The member with random parameters."""

    def build(self) -> TrainableReconstructor:
        """The member with trained parameters.

        Raises:
            UserError: as `load_parameters`.
        """
        return load_parameters(self)
