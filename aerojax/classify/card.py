"""A trained model's card: what it is, how it is to be read, which settings its training clips came from.

The card is stored as one JSON entry in the header of the weights, and decides how the model is read; the Markdown file
beside the weights is made from it.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from aerojax.core.errors import UserError

Setting = str | int | float | bool | None
Settings = tuple[tuple[str, Setting], ...]
"""Pairs of a dotted key and a plain value, ordered by key."""
TrainRotation = Literal["none", "z", "so3"]


@dataclass(frozen=True)
class Card:
    """What has to be known of a classifier besides its weights; hashable, so it can be part of a pytree's structure.

    name: for people.
    member: which kind of classifier it is, a key of `aerojax.classify.members.MEMBERS`.
    config: the member's configuration without its name.
    classes: names in the order of the logits.
    tokens, frames: Gaussians of a frame and frames of a clip in training.
    token_ensembles: disjoint subsets of a frame's tokens whose probabilities are averaged, as far as there are enough.
    scale_normalisation: length that positions are divided by, in the member's words.
    rotation_invariant: whether no rotation of the world changes the logits, whatever the weights.
    temperature: log-probabilities are divided by it, so that they mean what they say; fitted on validation clips.
    rotation: how the training clips were turned: not at all, about +Z, or uniformly over SO(3).
    settings: of the pipeline that made the training clips, such as ("crop_size", 128), ("reconstruct.grid", 64).
    record: JSON object of what made the weights and how good they are (command, seed, commit, results); "" if unknown.
    """

    name: str
    member: str
    config: Settings
    classes: tuple[str, ...]
    tokens: int
    frames: int
    token_ensembles: int
    scale_normalisation: str
    rotation_invariant: bool
    temperature: float = 1.0
    rotation: TrainRotation = "none"
    settings: Settings = ()
    record: str = ""

    def __post_init__(self) -> None:
        """Refuse what no clip could be read with.

        Raises:
            UserError: names the field and the values that work.
        """
        for name in ("tokens", "frames", "token_ensembles"):
            if getattr(self, name) < 1:
                raise UserError(
                    "invalid", f"{name} is {getattr(self, name)} in a classifier's card", "it must be at least 1"
                )
        if not 0 < self.temperature < float("inf"):
            problem = f"temperature is {self.temperature} in a classifier's card"
            raise UserError("invalid", problem, "it must be a positive number")

    def require(self, settings: Mapping[str, Setting]) -> None:
        """Refuse a running pipeline that makes other Gaussians than the classifier was trained on.

        Args:
            settings: of the running pipeline, by dotted key; keys that the card or the pipeline lacks are not compared.

        Raises:
            UserError: names each setting that differs, both values and the remedy.
        """
        trained = dict(self.settings)
        wrong = [key for key in sorted(trained.keys() & settings.keys()) if trained[key] != settings[key]]
        if wrong:
            found = "; ".join(f"{key} is {settings[key]!r}, in training it was {trained[key]!r}" for key in wrong)
            remedy = " ".join(f"{key}={trained[key]}" for key in wrong)
            raise UserError(
                "mismatch",
                f"the pipeline contradicts the card of the classifier {self.name!r}: {found}",
                f"set {remedy}, or give weights that were trained with these settings",
            )

    def to_json(self) -> str:
        """The header's entry."""
        plain = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        plain |= {"config": dict(self.config), "settings": dict(self.settings)}
        return json.dumps(plain | {"record": json.loads(self.record or "{}")})

    @staticmethod
    def from_json(text: str, *, source: str) -> Card:
        """Inverse of `to_json`.

        Args:
            text: the header's entry.
            source: the file, for the message.

        Raises:
            UserError: the text is no card, or names every field that is missing, unknown or of another type.
        """
        try:
            read = json.loads(text)
        except (ValueError, RecursionError):
            read = None
        if not isinstance(read, dict):
            raise UserError("unreadable", f"{source}: the card in its header is no JSON object", "fetch it again")
        values: dict[str, Any] = {"temperature": 1.0, **read}  # cards of before had none
        missing, unknown = sorted(_TYPES.keys() - values.keys()), sorted(values.keys() - _TYPES.keys())
        if missing:
            raise UserError(
                "missing", f"{source}: the card in its header lacks {', '.join(missing)}", "fetch it again or retrain"
            )
        wrong = [f"unknown field {name}" for name in unknown]
        wrong += [f"{name} is {values[name]!r}" for name, fits in _TYPES.items() if not fits(values[name])]
        if wrong:
            raise UserError(
                "invalid", f"{source}: the card in its header cannot be used: {'; '.join(wrong)}", "fetch it again"
            )
        values |= {name: tuple(sorted(values[name].items())) for name in ("config", "settings")}
        values |= {"classes": tuple(values["classes"])}
        return Card(**values | {"record": json.dumps(values["record"]) if values["record"] else ""})


def _text(value: Any) -> bool:
    return isinstance(value, str)


def _count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value > 0


def _pairs(value: Any) -> bool:
    return isinstance(value, dict) and all(isinstance(v, str | int | float | bool | None) for v in value.values())


_TYPES = {
    "name": _text,
    "member": _text,
    "config": _pairs,
    "classes": lambda value: isinstance(value, list) and all(map(_text, value)),
    "tokens": _count,
    "frames": _count,
    "token_ensembles": _count,
    "scale_normalisation": _text,
    "rotation_invariant": lambda value: isinstance(value, bool),
    "temperature": lambda value: isinstance(value, int | float) and not isinstance(value, bool),
    "rotation": lambda value: _text(value) and value in get_args(TrainRotation),
    "settings": _pairs,
    "record": lambda value: isinstance(value, dict),
}


def flat_settings(values: Mapping[str, Any]) -> Settings:
    """A nested mapping as pairs of dotted key and plain value; items of lists are keyed by their index."""
    found: dict[str, Setting] = {}
    for key, value in values.items():
        inner = dict(enumerate(value)) if isinstance(value, list | tuple) else value
        if isinstance(inner, Mapping):
            found |= {f"{key}.{name}": v for name, v in flat_settings({str(k): v for k, v in inner.items()})}
        else:
            found[key] = value if isinstance(value, str | int | float | bool | None) else str(value)
    return tuple(sorted(found.items()))


def nested_settings(settings: Settings) -> dict[str, Any]:
    """Inverse of `flat_settings` for mappings without lists."""
    found: dict[str, Any] = {}
    for key, value in settings:
        *folders, last = key.split(".")
        place = found
        for folder in folders:
            place = place.setdefault(folder, {})
        place[last] = value
    return found
