"""The list of a user's own models: a YAML file that says where each lies and how it is to be read."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from jaxtyping import Float

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.splits import SPLITS, Split

GLTF, WAVEFRONT, USD = (".glb", ".gltf"), (".obj",), (".usd", ".usda", ".usdc", ".usdz")
MESHES = (".stl", ".ply")
AXES = {sign + letter: (1.0 if sign == "+" else -1.0) * np.eye(3)[i] for sign in "+-" for i, letter in enumerate("XYZ")}
_LARGEST = sys.float_info.max
"""YAML's whole numbers have any size; beyond this no float holds them."""
_NEEDED = ("name", "file", "class")
_KINDS: dict[str, tuple[type, ...]] = {
    "name": (str,),
    "file": (str,),
    "class": (str,),
    "split": (str,),
    "forward": (str,),
    "up": (str,),
    "scale": (int, float, str),
    "animation": (int, str, type(None)),
    "speed": (int, float),
    "licence": (str,),
    "source": (str,),
}


@dataclass(frozen=True)
class ImportedModel:
    """One model of the list.

    name: unique, also the stem of its stage.
    file: `.glb`, `.gltf`, `.obj`, `.stl`, `.ply` or USD, absolute.
    label: one of `aerojax.core.types.CLASSES`; "class" in the file.
    split: that it belongs to; "test" where the list does not say.
    forward, up: axes of the file that point to the nose and upwards; an empty `up` takes the USD stage's own.
    scale: metres per unit, or "auto" for the class's rule (1 m wingspan, fuselage or motor diagonal).
    animation: index or name of the clip; None for a still model; "first" takes the first clip, if there is one,
        with those that move other nodes.
    speed: factor of playback.
    licence, source: of the model, for the truth of captures.
    """

    name: str
    file: Path
    label: str
    split: Split
    forward: str
    up: str
    scale: float | Literal["auto"]
    animation: int | str | None
    speed: float
    licence: str
    source: str


def read_models(path: Path) -> tuple[ImportedModel, ...]:
    """Read the list strictly.

    Raises:
        UserError: if the file cannot be read; names every field that is unknown, missing or wrong, all at once.
    """
    try:
        tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError("missing", f"list of models {path} does not exist", "check the path") from None
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:  # dates that are none, deep nesting
        raise UserError("unreadable", f"{path} is not readable YAML: {error}", "correct that line") from error
    if not isinstance(tree, dict) or set(tree) != {"models"} or not isinstance(tree["models"], list):
        raise UserError(
            "missing",
            f"{path}: holds no list `models:`, or more than it",
            "write `models:` and one `- name: …` a model",
        )
    problems = [f"  models[{i}]{_called(m)}: {p}" for i, m in enumerate(tree["models"]) for p in _problems(m, path)]
    names = [m.get("name") for m in tree["models"] if isinstance(m, dict)]
    twice = sorted({str(n) for n in names if n is not None and names.count(n) > 1})
    problems += [f"  name {name!r} is given to several models; every name is the stem of a file" for name in twice]
    if problems:
        raise UserError("invalid", f"{path} does not fit a list of models:\n" + "\n".join(problems))
    return tuple(_model(entry, path) for entry in tree["models"])


def _called(entry: Any) -> str:
    return f" ({entry['name']})" if isinstance(entry, dict) and isinstance(entry.get("name"), str) else ""


def _problems(entry: Any, path: Path) -> Iterator[str]:
    """Everything that is wrong with one model, in the order of the fields."""
    if not isinstance(entry, dict):
        yield f"expected fields, got {entry!r}; write `name:`, `file:` and `class:`"
        return
    unknown = sorted(str(key) for key in set(entry) - set(_KINDS))
    if unknown:
        yield f"unknown field(s) {', '.join(unknown)}; use {', '.join(_KINDS)}"
    for field in _NEEDED:
        if field not in entry:
            yield f"{field}: required field is missing"
    sound = {}
    for field, kinds in _KINDS.items():
        if field not in entry:
            continue
        if isinstance(entry[field], bool) or not isinstance(entry[field], kinds):
            expected = " or ".join("nothing" if k is type(None) else k.__name__ for k in kinds)
            yield f"{field}: expected {expected}, got {entry[field]!r}"
        else:
            sound[field] = entry[field]
    yield from _wrong_words(sound)
    yield from _wrong_numbers(sound)
    if "file" in sound:
        yield from _wrong_file(sound, path)


def _wrong_words(entry: dict[str, Any]) -> Iterator[str]:
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", entry.get("name", "a")):
        yield f"name: {entry['name']!r} is no file and prim name; use letters, digits and underscores, no digit first"
    if entry.get("class", CLASSES[0]) not in CLASSES:
        yield f"class: {entry['class']!r} is unknown; use {', '.join(CLASSES)}"
    if entry.get("split", "test") not in SPLITS:
        yield f"split: {entry['split']!r} is unknown; use {', '.join(SPLITS)}"
    for field in ("forward", "up"):
        if entry.get(field, "+X") not in AXES:
            yield f"{field}: {entry[field]!r} is no axis; use {', '.join(AXES)}"
    forward, up = entry.get("forward"), entry.get("up")
    if forward in AXES and up in AXES and forward[1] == up[1]:
        yield f"up: {up} lies along forward ({forward}); the two must be perpendicular"


def _wrong_numbers(entry: dict[str, Any]) -> Iterator[str]:
    scale, speed, animation = entry.get("scale", "auto"), entry.get("speed", 1.0), entry.get("animation", 0)
    if (isinstance(scale, str) and scale != "auto") or (not isinstance(scale, str) and not 0 < scale <= _LARGEST):
        yield f"scale: {scale!r} is neither auto nor a positive number; give metres per unit"
    if not 0 < speed <= _LARGEST:
        yield f"speed: {speed!r} must be a positive number; use 1.0 to play as it is, animation: none to stand still"
    if isinstance(animation, int) and animation < 0:
        yield f"animation: {animation} must not be negative; count clips from 0"


def _wrong_file(entry: dict[str, Any], path: Path) -> Iterator[str]:
    file = path.parent / entry["file"]
    kind = file.suffix.lower()
    if kind not in GLTF + WAVEFRONT + USD + MESHES:
        yield f"file: {entry['file']} has no known ending; use {', '.join(GLTF + WAVEFRONT + USD + MESHES)}"
        return
    if not file.is_file():
        yield f"file: {file} does not exist; give it relative to {path.name}"
    if kind in WAVEFRONT + USD + MESHES and "forward" not in entry:
        yield f"forward: is missing, and {kind} has no convention; say which axis the nose points along"
    if kind in WAVEFRONT + MESHES and "up" not in entry:
        yield f"up: is missing, and {kind} has no convention; say which axis points upwards"
    if kind in GLTF and (entry.get("forward") is None) != (entry.get("up") is None):
        forward, up = entry.get("forward", "+Z"), entry.get("up", "+Y")
        if forward[1:] == up[1:]:
            yield f"forward: {forward} and up: {up} lie along one line; give both (glTF's own are +Z and +Y)"


def _model(entry: dict[str, Any], path: Path) -> ImportedModel:
    """A model of the list, with what it leaves out filled in."""
    file = (path.parent / entry["file"]).resolve()
    gltf, animation = file.suffix.lower() in GLTF, entry.get("animation", "first")
    return ImportedModel(
        name=entry["name"],
        file=file,
        label=entry["class"],
        split=entry.get("split", "test"),
        forward=entry.get("forward", "+Z"),
        up=entry.get("up", "+Y" if gltf else ""),
        scale=scale if (scale := entry.get("scale", "auto")) == "auto" else float(scale),
        animation=None if animation == "none" else animation,
        speed=float(entry.get("speed", 1.0)),
        licence=entry.get("licence", ""),
        source=entry.get("source", ""),
    )


def body_from_file(forward: str, up: str) -> Float[np.ndarray, "3 3"]:
    """Rotation from the file's axes to the body's: nose +X, up +Z, hence +Y to the left."""
    nose, top = AXES[forward], AXES[up]
    return np.stack([nose, np.cross(top, nose), top])


def described(model: ImportedModel) -> str:
    """Every field but the folder of the file, as one line: two models that read alike convert alike."""
    return "; ".join(f"{f.name}={getattr(model, f.name)!r}" for f in fields(model) if f.name != "file")
