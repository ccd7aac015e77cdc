"""Help and mistakes that do not wait until JAX is loaded."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
import types
import typing
from pathlib import Path

import pytest
from support.act_configs import NAMES, config_of

from aerojax.core.config import default_of, door_of, members_of, to_dataclass
from experiments._launch.arguments import with_keys
from experiments._launch.command import REPOSITORY
from experiments._launch.front import is_bare, mistake
from experiments._launch.help import WIDTH, help_of
from experiments._launch.presets import presets_of
from experiments._launch.schema import schema_of
from experiments._launch.sources import field_words

CLASSIFY = "experiments.classify"


@pytest.mark.parametrize("act", NAMES)
def test_every_value_has_a_meaning_and_fits_the_screen(act):
    schema = schema_of(f"experiments.{act}")
    assert schema is not None
    assert [value.key for value in schema.values if len(value.about) < 5] == []
    text = help_of(f"experiments.{act}")
    assert text is not None and max(map(len, text.splitlines())) <= max(WIDTH, *map(len, text.split()))
    for value in schema.values:
        assert f"\n{value.group or value.key}=" in text, value.key


@pytest.mark.parametrize("act", NAMES)
def test_the_source_is_read_as_python_reads_it(act):
    """Keys of the static reader are the fields of the imported dataclass, doors' default members included."""

    def is_config(kind: object) -> bool:
        return isinstance(kind, type) and dataclasses.is_dataclass(kind)

    def options(kind: object) -> tuple:
        return typing.get_args(kind) if isinstance(kind, types.UnionType) else (kind,)

    def keys(config: type, prefix: str = "") -> set[str]:
        found, hints = set(), typing.get_type_hints(config)
        for one in dataclasses.fields(config):
            kind, default = hints[one.name], default_of(one)
            if (door := door_of(kind)) is not None:
                found.add(prefix + one.name)
                if default not in (None, dataclasses.MISSING):
                    found |= keys(members_of(door)[default.name], f"{prefix}{one.name}.")
            elif inner := [option for option in options(kind) if is_config(option)]:
                found |= keys(inner[0], f"{prefix}{one.name}.")
            else:
                found.add(prefix + one.name)
        return {key for key in found if key.rpartition(".")[2] != "name"}

    schema = schema_of(f"experiments.{act}")
    assert schema is not None
    assert {v.key for v in schema.values if v.key.rpartition(".")[2] != "name"} == keys(config_of(act))


def test_help_shows_kind_choices_default_and_presets():
    text = help_of("experiments.classify") or ""
    assert "preset=smoke|small|full\n" in text and "[CAPTURE]" in text.splitlines()[0]
    assert "pipeline.crop_size=INTEGER\n    side of the virtual-camera crops, pixels. Default: 128." in text
    assert "Default: 24 (smoke 4)." in text
    assert "# trust: from when on the answer is believed." in text
    assert "pipeline.reconstruct.grid" not in (help_of(CLASSIFY, {"reconstruct": "constant"}) or "")
    assert "train/ and val/ in each" in (help_of("experiments.train_classifier") or "")


def test_words_of_fields_are_found_in_docstrings():
    text = "Things.\n\n    a, b: two of them. c: one, over\n        two lines.\n\n    Not: a field.\n    "
    assert field_words(text, ["a", "b", "c"]) == {"a": "two of them.", "b": "two of them.", "c": "one, over two lines."}


@pytest.mark.parametrize(
    ("argument", "remedy"),
    [
        ("sead=1", "did you mean seed?"),
        ("crop_size=64", "did you mean pipeline.crop_size?"),
        ("pipeline.crop_sise=64", "did you mean pipeline.crop_size?"),
        ("pipeline.reconstruct.grd=3", "did you mean pipeline.reconstruct.grid?"),
        ("preset=smal", "did you mean small?"),
        ("reconstruct=hall", "did you mean hull?"),
        ("zzzzzz=1", "classify --help lists them"),
        ("capture=/nowhere/at/all", "there is no /nowhere/at/all"),
        ("/nowhere/at/all", "there is no /nowhere/at/all"),
    ],
)
def test_mistakes_are_named_with_a_remedy(argument, remedy):
    problem = mistake(CLASSIFY, [argument])
    assert problem is not None and remedy in problem and "\n" not in problem


@pytest.mark.parametrize(
    "arguments",
    [
        ["seed=1", "preset=smoke", "hydra.run.dir=/tmp/x", "-m"],
        ["pipeline.reconstruct.grid=16", "reconstruct=lgm", "++pipeline.lost_after=3", "~began"],
        ["preset=smoke,small", "trust.least_views=1e3"],
        ["pipeline.reconstruct.compat=true", "reconstruct=depthsplat"],
        [str(REPOSITORY)],
        [],
    ],
)
def test_what_may_be_said_is_let_through(arguments):
    assert mistake(CLASSIFY, arguments) is None


@pytest.mark.parametrize("act", NAMES)
def test_every_configuration_of_conf_is_known(act):
    problems = [mistake(f"experiments.{act}", [f"{key}=null"]) for key in presets_of(act).changed]
    assert [problem for problem in problems if problem and "has no value" in problem] == []


def test_a_path_that_the_shell_cut_is_recognised(tmp_path):
    problem = mistake(CLASSIFY, [f"capture={tmp_path}", "flight"])
    assert problem is not None and "put quotes around a path with spaces" in problem
    assert "no key=value" in (mistake("experiments.measure_cost", ["flight"]) or "")


def test_a_path_alone_gets_its_key():
    config = config_of("classify")
    assert with_keys(["my flight", "seed=1", "-m"], config) == ["capture=my flight", "seed=1", "-m"]
    assert with_keys(["~/flight"], config) == ["capture=~/flight"]
    assert with_keys(["flight"], config_of("measure_cost")) == ["flight"]
    assert [is_bare(one) for one in ("a/b", "a=b", "-m", "+a", "~a", "")] == [True, False, False, False, False, False]


def test_home_is_expanded(monkeypatch, tmp_path):
    @dataclasses.dataclass(frozen=True)
    class Places:
        one: Path

    monkeypatch.setenv("HOME", str(tmp_path))
    assert to_dataclass({"one": "~/flight"}, Places).one == tmp_path / "flight"


@pytest.mark.parametrize("command", [["-m", "experiments.classify"], ["-m", "aerojax", "classify"]])
def test_neither_help_nor_a_mistake_loads_jax(command):
    """What must not be loaded is made impossible to load."""
    block = "import sys; sys.modules['jax'] = sys.modules['hydra'] = sys.modules['numpy'] = None; import runpy; "
    module, *rest = command[1:]
    for argument, code in (("sead=1", 2), ("--help", 0)):
        run = f"sys.argv = ['-m', *{[*rest, argument]}]; sys.orig_argv = ['python', '-m', '{module}', *sys.argv[1:]]; "
        run += f"runpy.run_module('{module}', run_name='__main__', alter_sys=False)"
        done = subprocess.run(
            [sys.executable, "-c", block + run], cwd=REPOSITORY, capture_output=True, text=True, check=False
        )
        assert done.returncode == code, done.stderr
        assert "Traceback" not in done.stderr
        assert ("did you mean seed?" in done.stderr) if code else ("capture=PATH" in done.stdout)
