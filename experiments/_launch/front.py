"""What a command line is told before anything heavy is loaded: help, and mistakes in keys, choices and paths."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

from experiments._launch.help import help_of
from experiments._launch.presets import CONF_DIR, presets_of
from experiments._launch.schema import Schema, Value, schema_of

PACKAGE = __name__.removesuffix("._launch.front")
_OWN = ("hydra.", "hydra/")
"""Beginnings of keys that are Hydra's."""


def before_loading() -> None:
    """For `python -m experiments.<act>`, while only the package is imported: answer what can be answered already."""
    begun = sys.orig_argv
    module = begun[begun.index("-m") + 1] if "-m" in begun[:-1] else ""
    if module.rpartition(".")[0] == PACKAGE:
        answer(module, sys.argv[1:])


def answer(module: str, arguments: Sequence[str]) -> None:
    """Print help, or name a mistake, and end the process; return where neither is asked for.

    Args:
        module: of the act.
        arguments: of the command line.
    """
    sys.excepthook = _quiet_interrupt
    if {"--help", "-h"} & set(arguments):
        text = help_of(module, _chosen(arguments))
        if text is not None:
            print(text)
            sys.exit(0)
    problem = mistake(module, arguments)
    if problem:
        print(f"error: {problem}", file=sys.stderr)
        sys.exit(2)


def _quiet_interrupt(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if issubclass(kind, KeyboardInterrupt):
        print("interrupted", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


def mistake(module: str, arguments: Sequence[str]) -> str | None:
    """What is wrong with a command line, as far as its configuration's source tells; None if nothing is."""
    schema = schema_of(module)
    if schema is None:
        return None
    act = module.rpartition(".")[2]
    choices = presets_of(act).choices
    given = [value.key for value in schema.values if value.given]
    bare = [one for one in arguments if is_bare(one)]
    if bare and not given:
        return f"{bare[0]!r} is no key=value; {act} --help lists the keys"
    if len(bare) > 1 or (bare and any(one.startswith(f"{given[0]}=") for one in arguments)):
        return f"{given[0]} is given twice ({bare[-1]!r}); put quotes around a path with spaces: '{given[0]}=my folder'"
    named = [f"{given[0]}={one}" if is_bare(one) else one for one in arguments]
    pairs = [one.partition("=") for one in named if "=" in one and not one.startswith(("-", "+", "~"))]
    problems = (_problem(key, value, schema, choices, act) for key, _, value in pairs)
    return next(filter(None, problems), None)


def is_bare(argument: str) -> bool:
    """Whether an argument of a command line is a path or name without a key."""
    return (
        bool(argument)
        and "=" not in argument
        and (not argument.startswith(("-", "+", "~")) or argument.startswith("~/"))
    )


def _chosen(arguments: Sequence[str]) -> dict[str, str]:
    return {key: value for key, equals, value in (one.partition("=") for one in arguments) if equals}


def _problem(key: str, value: str, schema: Schema, choices: Mapping[str, Sequence[str]], act: str) -> str | None:
    if key.startswith(_OWN) or "@" in key or "/" in key:
        return None
    known = schema.keys() | choices.keys() | {folder.name for folder in CONF_DIR.iterdir() if folder.is_dir()}
    if key not in known and not any(key.startswith(f"{one.key}.") for one in schema.values if one.kind.startswith("{")):
        near = _near(key, sorted(known))
        return f"{act} has no value {key!r}; " + (f"did you mean {near}?" if near else f"{act} --help lists them")
    one = next((one for one in schema.values if key in (one.key, one.group)), None)
    options = choices.get(key) or (one.kind.split("|") if one is not None and _is_choice(one) else ())
    plain = value and not set(value) & set(",[]{}()'\"$")
    if options and plain and value not in options and value != "null":
        near = _near(value, list(options))
        return f"{key}={value}: " + (f"did you mean {near}? " if near else "") + f"Choose one of {', '.join(options)}"
    if one is not None and one.given and plain and value != "null" and not Path(value).expanduser().exists():
        return f"{key}: there is no {value}; correct the path"
    return None


def _is_choice(value: Value) -> bool:
    return "|" in value.kind and all(option.islower() for option in value.kind.split("|"))


def _near(word: str, known: list[str]) -> str | None:
    """The known word that was most likely meant: one that ends in it, or is spelt almost so."""
    ends = [one for one in known if one.rpartition(".")[2] == word]
    near = ends or difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    if not near:
        last = {one.rpartition(".")[2]: one for one in reversed(known)}
        near = [last[found] for found in difflib.get_close_matches(word.rpartition(".")[2], last, n=1, cutoff=0.75)]
    return near[0] if near else None
