"""Names on the command line mean what they say, whatever letters and digits they are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from experiments._launch.arguments import with_quotes


@dataclass(frozen=True)
class Inner:
    name: str = "a"
    size: int = 1


@dataclass(frozen=True)
class Config:
    capture: Path | None = None
    word: str = ""
    number: int = 0
    paths: tuple[Path, ...] = ()
    inner: Inner = field(default_factory=Inner)


def read(argument: str):
    (quoted,) = with_quotes([argument], Config)
    return OverridesParser.create().parse_override(quoted).value()


@pytest.mark.parametrize(
    "value",
    [
        "üb",
        "第一/左",
        "2024_05_01",
        "20240501",
        "1e5",
        "0x10",
        "true",
        "nan",
        "a b (1)",
        "it's",
        "a=b",
        "q:z",
        "plain/path-1.2",
        "back\\slash\\",
        "x{y}",
    ],
)
@pytest.mark.parametrize("key", ["capture", "word", "inner.name"])
def test_text_is_read_as_it_stands(key, value):
    assert read(f"{key}={value}") == value


@pytest.mark.parametrize(
    "argument",
    [
        "number=2024_05_01",
        "inner.size=3",
        "capture=null",
        "capture=plain",
        "capture='2024_05_01'",
        'word="üb"',
        "word=${inner.name}",
        "paths=[a,b]",
        "preset=full",
        "hydra.run.dir=/tmp/x",
        "-m",
        "--help",
        "~number",
    ],
)
def test_what_needs_no_quotes_stays(argument):
    assert with_quotes([argument], Config) == [argument]


def test_other_keys_get_quotes_for_letters_that_hydra_does_not_know():
    assert with_quotes(["hydra.run.dir=/tmp/üb"], Config) == ["hydra.run.dir='/tmp/üb'"]


def test_sweeps_stay_sweeps():
    quoted = with_quotes(["-m", "capture=üa,2024_05_01", "number=1,2", "word=a,b"], Config)
    assert quoted == ["-m", "capture='üa','2024_05_01'", "number=1,2", "word=a,b"]
    assert with_quotes(["-m", "capture=2024_05_01,b"], Config)[1] == "capture='2024_05_01','b'"
    override = OverridesParser.create().parse_override(quoted[1])
    assert override.is_sweep_override() and override.sweep_string_iterator is not None
