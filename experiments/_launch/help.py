"""What `--help` of an act prints: every value with its kind, default and meaning, in 80 columns."""

from __future__ import annotations

import ast
import textwrap

from experiments._launch.presets import Presets, presets_of
from experiments._launch.schema import Schema, Value, schema_of
from experiments._launch.sources import tree_of

WIDTH = 80
_CLOSING = """\
A value of several is written [a,b]; text with spaces needs the shell's quotes: 'capture=my flight'.
Files go to a new folder of runs/ in the working directory, with the resolved configuration; hydra.run.dir=DIR names \
another. -m runs every combination of comma-separated values (seed=0,1,2); -c job prints the configuration and stops."""


def help_of(module: str, chosen: dict[str, str] | None = None) -> str | None:
    """The help of an act; None where the module has no configuration.

    Args:
        module: such as `experiments.classify`.
        chosen: members by group that the command line names; their values are listed.
    """
    schema = schema_of(module, chosen)
    if schema is None:
        return None
    act = module.rpartition(".")[2]
    presets = presets_of(act)
    given = next((value for value in schema.values if value.given), None)
    place = f" [{given.key.upper()}]" if given else ""
    parts = [
        _wrapped(f"python -m experiments.{act}{place} [key=value ...] [-m] [--help]", ""),
        _wrapped(_about(module), ""),
    ]
    if presets.about:
        parts.append(
            "\n".join(
                _wrapped(line, "  ") if len(line) > WIDTH - 2 else f"  {line}" for line in presets.about.splitlines()
            )
        )
    choices = [_choice(group, presets) for group in presets.choices if group not in _doors(schema)]
    values = [_described(value, presets, schema) for value in schema.values if value.key not in presets.choices]
    parts += ["\n".join([*choices, *values]), "\n".join(_wrapped(line, "") for line in _CLOSING.splitlines())]
    return "\n\n".join(parts)


def _about(module: str) -> str:
    return " ".join((ast.get_docstring(tree_of(module)) or "").split("\n\n")[0].split())


def _doors(schema: Schema) -> set[str]:
    return {value.group for value in schema.values if value.group}


def _choice(group: str, presets: Presets) -> str:
    about = "sizes that fit together" if group == "preset" else f"a group of values in conf/{group}/"
    head, options = _head(group, "|".join(presets.choices[group]))
    return head + _wrapped(f"{about}.{options} Default: {presets.defaults[group]}.", "    ")


def _head(key: str, kind: str) -> tuple[str, str]:
    """The line that a value begins with, and its choices as a sentence where they do not fit there."""
    if len(key) + len(kind) < WIDTH or "|" not in kind:
        return f"{key}={kind}\n", ""
    return f"{key}=NAME\n", f" One of {', '.join(kind.split('|'))}."


def _described(value: Value, presets: Presets, schema: Schema) -> str:
    words = [value.about.rstrip("."), presets.notes.get(value.key, "").rstrip(".")]
    key = value.group or value.key
    if value.group:
        words.append(f"Its values are {value.key}.…; --help {value.group}=NAME lists another's")
    words.append(_default(value, presets))
    heads = [_wrapped(f"{head}", "") + "\n" for head in _sections(value, schema)]
    head, options = _head(key, value.kind)
    return "".join([*heads, head, _wrapped(" ".join(f"{word}." for word in words if word) + options, "    ")])


def _sections(value: Value, schema: Schema) -> list[str]:
    """What the dataclasses are for whose first value this is."""
    found = []
    for key, about in schema.sections.items():
        first = next((one.key for one in schema.values if one.key.startswith(f"{key}.")), None)
        if first == value.key and about:
            found.append(f"# {key}: {about}")
    return found


def _default(value: Value, presets: Presets) -> str:
    changed = dict(presets.changed.get(value.key, {}))
    default = changed.pop("", value.default)
    others = ", ".join(f"{preset} {text}" for preset, text in changed.items())
    if not default:
        return f"By preset: {others}" if others else "Must be given"
    return f"Default: {default}" + (f" ({others})" if others else "")


def _wrapped(text: str, indent: str) -> str:
    return textwrap.fill(
        text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )
