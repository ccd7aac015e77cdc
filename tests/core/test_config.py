"""Mappings become dataclasses strictly; a door's member is chosen by its name."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest
from support.toy_door import BallConfig, BoxConfig, ShapeConfig

from aerojax.core.config import part_of, to_dataclass, to_mapping
from aerojax.core.errors import UserError


@dataclass(frozen=True)
class Scene:
    """Fields of every kind."""

    size: int
    scale: float = 0.5
    folder: Path | None = None
    kind: Literal["flat", "round"] = "flat"
    spots: tuple[tuple[float, float], ...] = ()
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Toy:
    """A member by default, one without a default, and one that may be absent."""

    shape: ShapeConfig = field(default_factory=BallConfig)
    other: ShapeConfig | None = None


@dataclass(frozen=True)
class Box:
    """A member that has to be named, in a dataclass inside another one."""

    toy: Toy
    inner: ShapeConfig


def test_values_arrive_with_their_types():
    made = to_dataclass({"size": 3, "scale": 2, "folder": "a/b", "kind": "round", "spots": [[1, 2.5]]}, Scene)
    assert made == Scene(3, 2.0, Path("a/b"), "round", ((1.0, 2.5),)) and isinstance(made.scale, float)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "size: required key is missing"),
        ({"size": 1.5}, "size: expected int, got 1.5"),
        ({"size": True}, "size: expected int, got True"),
        ({"size": 1, "scale": "big"}, "scale: expected float, got 'big'"),
        ({"size": 1, "folder": 3}, "folder: expected Path, got 3"),
        ({"size": 1, "kind": "square"}, "kind: expected one of 'flat', 'round'; got 'square'"),
        ({"size": 1, "colour": 2}, "unknown key(s) colour"),
        ({"size": 1, 3: 2, "colour": 2}, "unknown key(s) 3, colour"),
        ({"size": 1, "names": [1]}, "names[0]: expected str, got 1"),
        ({"size": 1, "names": 1}, "names[0]: expected str, got 1"),
        ({"size": 1, "names": None}, "names: expected a list, got None"),
        ({"size": 1, "names": {"a": 1}}, "names: expected a list, got {'a': 1}"),
        ({"size": 1, "spots": [[1, 2], [1, "x"]]}, "spots[1][1]: expected float, got 'x'"),
    ],
)
def test_every_mistake_names_its_key(values, message):
    with pytest.raises(UserError) as caught:
        to_dataclass(values, Scene, source="scene.yaml")
    assert "scene.yaml does not fit Scene" in str(caught.value) and message in str(caught.value)
    assert caught.value.code == "mismatch"


def test_one_value_stands_for_a_list_of_one():
    assert to_dataclass({"size": 1, "names": "abc"}, Scene).names == ("abc",)
    assert to_dataclass({"size": 1, "names": []}, Scene).names == ()


def test_mapping_and_back():
    scene = Scene(2, folder=Path("x"), spots=((0.0, 1.0),))
    assert to_dataclass(to_mapping(scene), Scene) == scene
    box = Box(Toy(other=BoxConfig((1.0, 2.0))), BallConfig(radius=4.0))
    assert to_dataclass(to_mapping(box), Box) == box


def test_the_name_chooses_the_member():
    assert to_dataclass({"shape": {"name": "box", "sides": [1, 2]}}, Toy) == Toy(BoxConfig((1.0, 2.0)))
    assert to_dataclass({"other": {"name": "ball", "radius": 3}}, Toy).other == BallConfig(radius=3.0)
    assert to_dataclass({"name": "box", "sides": [1]}, ShapeConfig) == BoxConfig((1.0,))


def test_without_a_name_it_is_the_default_member():
    assert to_dataclass({"shape": {"radius": 2}}, Toy) == Toy(BallConfig(radius=2.0))
    assert to_dataclass({}, Toy) == Toy()


def test_the_mapping_of_a_member_has_its_own_fields():
    assert to_mapping(Toy(BoxConfig((1.0,)))) == {"shape": {"sides": [1.0], "name": "box"}, "other": None}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"toy": {"shape": {"name": "cone"}}, "inner": {"name": "ball"}}, "toy.shape: name is 'cone'; choose one of "),
        ({"toy": {}, "inner": {"radius": 1}}, "inner: name is None; choose one of ball, box"),
        ({"toy": {"other": {"radius": 1}}, "inner": {"name": "ball"}}, "toy.other: name is None; choose one of "),
        ({"toy": {"shape": {"name": "box"}}, "inner": {"name": "ball"}}, "toy.shape.sides: required key is missing"),
        ({"toy": {"shape": {"sides": [1]}}, "inner": {"name": "ball"}}, "unknown key(s) sides"),
        ({"toy": {"shape": {"radius": "x"}}, "inner": {"name": "ball"}}, "toy.shape.radius: expected float, got 'x'"),
        ({"toy": {}, "inner": 3}, "inner: name is None; choose one of ball, box"),
        ({"toy": 3, "inner": {"name": "ball"}}, "toy: "),
    ],
)
def test_a_member_that_does_not_fit_names_its_key(values, message):
    with pytest.raises(UserError) as caught:
        to_dataclass(values, Box)
    assert message in str(caught.value)


def test_the_part_of_a_configuration_leaves_out_what_was_added():
    @dataclass(frozen=True)
    class Base:
        a: int = 1
        b: tuple[int, ...] = ()

    @dataclass(frozen=True)
    class Added(Base):
        folder: str = ""

    found = part_of(Added(2, (3,), "x"), Base)
    assert type(found) is Base and found == Base(2, (3,))
