"""What Hydra composes a configuration from: the defaults of the act's dataclass, then `conf/`, then the command line.

A number has one home, the dataclass: `store_defaults` gives its defaults to Hydra as the first file of every act
(`config_defaults`, which `conf/base.yaml` begins with), and the members behind each door as a group of its own, so that
`reconstruct=hull` chooses one with its defaults. YAML holds only what a preset changes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, get_type_hints

from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from omegaconf import MISSING, OmegaConf

from aerojax.core.config import default_of, door_of, members_of, to_plain
from experiments._launch.presets import CONF_DIR

DEFAULTS = "config_defaults"
"""Name under which `conf/base.yaml` finds the defaults of the act that runs."""


def store_defaults(config_type: type) -> None:
    """Give Hydra the defaults of an act's configuration and the groups of the doors in it.

    A door that is the field `pipeline.reconstruct` and whose members stand in `aerojax.reconstruct.members` is the
    group `reconstruct`; its option by default is the field's default member.
    """
    store, chosen = ConfigStore.instance(), []
    for path, door, default in doors_of(config_type):
        group = door.members.split(".")[-2]
        for name, member in members_of(door).items():
            store.store(name, dict(defaults_of(member)), group=group, package=path)
        chosen.append({group: default})
    store.store(DEFAULTS, {"defaults": ["_self_", *chosen], **defaults_of(config_type)}, package="_global_")


def composed(name: str, config_type: type, *overrides: str) -> dict[str, Any]:
    """The values that `python -m experiments.<name> <overrides>` gives `config_type`, as plain containers.

    Raises:
        HydraException: an override does not fit.
        OmegaConfBaseException: a required value is missing.
    """
    GlobalHydra.instance().clear()
    store_defaults(config_type)
    with initialize_config_dir(str(CONF_DIR), version_base="1.3"):
        values = OmegaConf.to_container(compose(name, list(overrides)), resolve=True, throw_on_missing=True)
    assert isinstance(values, dict)
    return {str(key): value for key, value in values.items()}


def defaults_of(config: Any) -> dict[str, Any]:
    """Values of a dataclass, nested: an instance's, or a class's defaults with `???` where there is none.

    Doors are left out, because their groups have the values.
    """
    values: dict[str, Any] = {}
    for name, kind, value in _fields(config):
        if door_of(kind) is None:
            values[name] = defaults_of(value) if dataclasses.is_dataclass(value) else to_plain(value)
    return values


def doors_of(config: Any, prefix: str = "") -> Iterator[tuple[str, type, str | None]]:
    """Every door in a dataclass: dotted path of its field, its base class, and the name of the member by default.

    Raises:
        ValueError: a field's default changes a value of its member, which the group would lose.
    """
    for name, kind, value in _fields(config):
        door = door_of(kind)
        if door is None:
            if dataclasses.is_dataclass(value):
                yield from doors_of(value, f"{prefix}{name}.")
        elif value in (None, MISSING):
            yield prefix + name, door, value
        elif defaults_of(value) != defaults_of(type(value)):
            raise ValueError(f"{prefix}{name} must be a member with its own defaults")
        else:
            yield prefix + name, door, value.name


def _fields(config: Any) -> Iterator[tuple[str, Any, Any]]:
    """Name, type and value of each field; a dataclass without a default stands for itself."""
    hints = get_type_hints(config if isinstance(config, type) else type(config))
    for field in dataclasses.fields(config):
        kind = hints[field.name]
        value = default_of(field) if isinstance(config, type) else getattr(config, field.name)
        if value is dataclasses.MISSING:
            value = kind if dataclasses.is_dataclass(kind) and door_of(kind) is None else MISSING
        yield field.name, kind, value
