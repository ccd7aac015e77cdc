"""A door with two members, for the tests of configurations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal


@dataclass(frozen=True)
class ShapeConfig:
    """The door."""

    members: ClassVar[str] = "support.toy_door"


@dataclass(frozen=True)
class BallConfig(ShapeConfig):
    """A member with a default for every field."""

    name: Literal["ball"] = "ball"
    radius: float = 1.0


@dataclass(frozen=True)
class BoxConfig(ShapeConfig):
    """A member with a required field."""

    sides: tuple[float, ...]
    name: Literal["box"] = "box"


MEMBERS: dict[str, type[ShapeConfig]] = {"ball": BallConfig, "box": BoxConfig}
