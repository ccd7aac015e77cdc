"""Arguments of the command line as Hydra's grammar wants them: paths and other text need no quotes.

Hydra reads `capture=2024_05_01` as the number 20240501 and knows no letters beyond ASCII outside quotes.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, QuotedString
from hydra.errors import HydraException

from experiments._launch.front import is_bare

_QUOTED = ("'", '"', "[", "{", "(")
"""What a value begins with that is quoted already or is no plain text."""


def with_keys(arguments: Sequence[str], config_type: type[Any]) -> list[str]:
    """The arguments, with the key before a path that stands alone: `DIR` is `capture=DIR`.

    The key is that of the field with the metadata `given`; without such a field they stay as they are.
    """
    given = next((one.name for one in dataclasses.fields(config_type) if one.metadata.get("given")), None)
    return [f"{given}={one}" if given and is_bare(one) else one for one in arguments]


def with_quotes(arguments: Sequence[str], config_type: type[Any]) -> list[str]:
    """The arguments, with quotes around values that are text and that Hydra would refuse or read as something else.

    Args:
        arguments: of the command line, without the program's name.
        config_type: the act's configuration, whose fields say what is text.
    """
    sweeps = "-m" in arguments or "--multirun" in arguments
    return [_with_quotes(one, config_type, sweeps=sweeps) for one in arguments]


def _with_quotes(argument: str, config_type: type[Any], *, sweeps: bool) -> str:
    key, equals, value = argument.partition("=")
    if not equals or key.startswith("-") or not value or value.startswith(_QUOTED):
        return argument
    text = _is_text(key.lstrip("+"), config_type)
    if _reads_as_meant(argument, value, text=text) or not (text or not value.isascii()):
        return argument
    values = value.split(",") if sweeps else [value]
    return f"{key}={','.join(map(_quoted, values))}"


def _reads_as_meant(argument: str, value: str, *, text: bool) -> bool:
    try:
        override = OverridesParser.create().parse_override(argument)
    except HydraException:
        return False
    read = override.value()
    if isinstance(read, ChoiceSweep) and read.simple_form:
        return not text or all(isinstance(one, (str, QuotedString)) for one in read.list)
    return not text or read is None or override.is_sweep_override() or read == value


def _quoted(value: str) -> str:
    # Within quotes a backslash is itself, but before a quote it is doubled (Hydra's grammar, "Quoted values").
    stem = value.rstrip("\\")
    return "'" + stem.replace("'", "\\'") + "\\" * 2 * (len(value) - len(stem)) + "'"


def _is_text(key: str, config_type: type[Any]) -> bool:
    """Whether the field with this dotted key takes a path or a string."""
    kind: Any = config_type
    for name in key.split("."):
        if not dataclasses.is_dataclass(kind):
            return False
        kind = get_type_hints(kind).get(name)
    kinds = get_args(kind) if get_origin(kind) in (Union, types.UnionType) else (kind,)
    return any(one in (Path, str) for one in kinds)
