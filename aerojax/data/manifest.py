"""What generated data sets consist of, as their `dataset.json` say: sequences and identities."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from aerojax.core.errors import UserError

FORMAT = "aerojax-dataset"
SPLITS = ("train", "val", "test")


@dataclass(frozen=True)
class IdentityEntry:
    """One individual: `asset` is its stage on disk, `split` the part of the data set that alone may show it."""

    name: str
    label: str
    family: str
    split: str
    asset: Path


@dataclass(frozen=True, eq=False)
class TrueCamera:
    """Where a camera really stood, in sequences whose written calibration is wrong on purpose."""

    name: str
    K: Float64[np.ndarray, "3 3"]
    world_from_cam: Float64[np.ndarray, "4 4"]


@dataclass(frozen=True)
class SequenceEntry:
    """One sequence: the capture in `folder`, and the identities of its objects, the one it is about first.

    radius: metres from the cameras to the place that they look at, where the rig has such a distance.
    true_cameras: empty where the written calibration is right.
    """

    folder: Path
    name: str
    label: str
    identity: str
    split: str
    rig: str
    frames: int
    fps: float
    objects: tuple[str, ...]
    radius: float | None = None
    true_cameras: tuple[TrueCamera, ...] = ()


@dataclass(frozen=True)
class DatasetEntries:
    """The sequences and identities of one or several data sets that are described together."""

    folders: tuple[Path, ...]
    sequences: tuple[SequenceEntry, ...]
    identities: tuple[IdentityEntry, ...]

    @property
    def rigs(self) -> tuple[str, ...]:
        """Names of the camera networks, sorted."""
        return tuple(sorted({sequence.rig for sequence in self.sequences}))


def read_datasets(folders: Sequence[Path]) -> DatasetEntries:
    """Read the manifests of data sets.

    Raises:
        UserError: no folder is given, one has no `dataset.json`, or that is damaged or of another format.
    """
    if not folders:
        raise UserError("missing", "dataset: no folder is given", "use dataset=DIR or dataset=[DIR,DIR]")
    parts = [_read(folder) for folder in folders]
    sequences = tuple(sequence for part in parts for sequence in part.sequences)
    identities = tuple(identity for part in parts for identity in part.identities)
    if not sequences:
        raise UserError("missing", f"{folders[0] / 'dataset.json'}: lists no sequences", "generate some first")
    return DatasetEntries(tuple(folders), sequences, identities)


def _read(folder: Path) -> DatasetEntries:
    path = folder / "dataset.json"
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        raise UserError(
            "missing", f"{path}: does not exist", "generate the data set to its end, or correct dataset="
        ) from None
    except ValueError:
        raise UserError(
            "unreadable", f"{path}: is not valid JSON", "run the generator again, which writes it anew"
        ) from None
    if not isinstance(raw, dict) or raw.get("format") != FORMAT:
        raise UserError("unreadable", f"{path}: format is not {FORMAT}", "name the folder of a generated data set")
    try:
        sequences = tuple(_sequence(folder, entry) for entry in raw["sequences"])
        identities = tuple(_identity(folder, entry) for entry in raw["identities"])
    except KeyError as error:
        raise UserError(
            "missing", f"{path}: {error.args[0]} is missing", "run the generator again, which writes it anew"
        ) from None
    return DatasetEntries((folder,), sequences, identities)


def _sequence(folder: Path, entry: dict[str, Any]) -> SequenceEntry:
    return SequenceEntry(
        folder=folder / entry["folder"],
        name=entry["name"],
        label=entry["class"],
        identity=entry["identity"],
        split=entry["split"],
        rig=entry["rig"],
        frames=entry["frames"],
        fps=float(entry["fps"]),
        objects=tuple(item["identity"] for item in entry["objects"]),
        radius=entry.get("radius_m"),
        true_cameras=tuple(_true_camera(camera) for camera in entry.get("true_cameras", ())),
    )


def _true_camera(camera: dict[str, Any]) -> TrueCamera:
    return TrueCamera(camera["name"], np.array(camera["K"], float), np.array(camera["world_from_cam"], float))


def _identity(folder: Path, entry: dict[str, Any]) -> IdentityEntry:
    return IdentityEntry(entry["name"], entry["class"], entry["family"], entry["split"], folder / entry["asset"])
