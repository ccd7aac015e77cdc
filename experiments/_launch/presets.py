"""What `conf/` adds to an act's values: its presets and groups, comments, and the values that presets change."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

CONF_DIR = Path(__file__).resolve().parents[2] / "conf"
_CHOICE = re.compile(r"^ *- (?:override )?/?(\w+)(?:@[\w.]+)?: *(\S+)", re.MULTILINE)
_SIZES = ("smoke", "small", "full", "published")
_PARENT = re.compile(r"^ *- (\w+)(?: *#.*)?$", re.MULTILINE)
_COMMENTED = re.compile(r"^((?:#.*\n)+)(\w+):", re.MULTILINE)


@dataclass(frozen=True)
class Presets:
    """What `conf/<act>.yaml` and its folder say.

    about: the comment at the file's head.
    choices: by group, such as `preset`, the names to choose from. defaults: by group, the one that is taken.
    notes: comments above values, by key.
    changed: by dotted key, the values that the act's file (under "") and its presets give instead of the default.
    """

    about: str
    choices: Mapping[str, tuple[str, ...]]
    defaults: Mapping[str, str]
    notes: Mapping[str, str]
    changed: Mapping[str, Mapping[str, str]]


def presets_of(act: str, folder: Path = CONF_DIR) -> Presets:
    """Read an act's configuration files; an act without one has nothing to say."""
    path = folder / f"{act}.yaml"
    if not path.is_file():
        return Presets("", {}, {}, {}, {})
    text = path.read_text(encoding="utf-8")
    about = re.match(r"(?:#.*\n)*", text)
    parents = [presets_of(name, folder) for name in _PARENT.findall(text) if name not in ("base", "_self_")]
    choices = {group: names for parent in parents for group, names in parent.choices.items()}
    defaults = {group: name for parent in parents for group, name in parent.defaults.items()}
    for group, default in _CHOICE.findall(text):
        own = folder / act if group == "preset" else folder / group
        names = {path.stem.rpartition("_")[2] if group == "preset" else path.stem for path in own.glob("*.yaml")}
        if group == "preset" and not names:
            names = {path.stem for path in (folder / "preset").glob("*.yaml")}
        if names and not default.startswith("$"):
            choices[group] = tuple(sorted(names, key=lambda name: (_SIZES.index(name) if name in _SIZES else -1, name)))
            defaults[group] = default
    changed = {key: dict(given) for parent in parents for key, given in parent.changed.items()}
    for preset, file in [("", path), *((file.stem, file) for file in sorted((folder / act).glob("*.yaml")))]:
        for key, value in _flat(yaml.safe_load(file.read_text(encoding="utf-8")) or {}):
            if key.split(".")[0] not in ("defaults", "hydra"):
                changed.setdefault(key, {})[preset] = value
    notes = {key: _words(comment) for comment, key in _COMMENTED.findall(text)}
    return Presets(_words(about[0] if about else "", lines=True), choices, defaults, notes, changed)


def _words(comment: str, *, lines: bool = False) -> str:
    stripped = [line.lstrip("#").removeprefix(" ").rstrip() for line in comment.splitlines() if "@package" not in line]
    return ("\n" if lines else " ").join(stripped)


def _flat(values: Any, prefix: str = "") -> list[tuple[str, str]]:
    if isinstance(values, dict) and (values or not prefix):
        return [
            pair for key, value in values.items() for pair in _flat(value, f"{prefix}.{key}" if prefix else str(key))
        ]
    return [(prefix, yaml.safe_dump(values, default_flow_style=True, width=10_000).removesuffix("...\n").strip())]
