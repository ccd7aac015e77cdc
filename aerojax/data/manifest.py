"""The manifest of a data set, `dataset.json`: how its rigs were generated, its identities and its sequences.

Here alone it is read and written. In memory every path leads from where the process runs; in the file they are relative
to the data set's folder. A finished sequence holds its own entry in `sequence.json`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float64

from aerojax.core.errors import UserError
from aerojax.core.files import write_json

FORMAT, VERSION = "aerojax-dataset", 1
MANIFEST, ENTRY = "dataset.json", "sequence.json"
"""Files of a data set and of a finished sequence in it."""

_AGAIN = "run the generator again, which writes it anew"
_T = TypeVar("_T")


@dataclass(frozen=True)
class IdentityEntry:
    """One individual: `asset` is its stage on disk, `split` the part of the data set that alone may show it.

    licence, source: of the asset.
    """

    name: str
    label: str
    family: str
    split: str
    asset: Path
    licence: str
    source: str


@dataclass(frozen=True, eq=False)
class TrueCamera:
    """Where a camera really stood, in sequences whose written calibration is wrong on purpose."""

    name: str
    K: Float64[np.ndarray, "3 3"]
    world_from_cam: Float64[np.ndarray, "4 4"]


@dataclass(frozen=True)
class SequenceEntry:
    """One sequence: the capture in `folder`, and the identities of its objects, the one it is about first.

    objects: object k of the truth, counted from 1, is the k-th of these.
    cameras: how many watch.
    distance: metres, mean over cameras and frames to the first object.
    frames_below_min_cameras: frames that fewer cameras saw than the rig asks for.
    radius, elevation_deg: metres from the cameras to the place that they look at and their elevation above it, where
        the rig has such.
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
    cameras: int
    distance: float
    frames_below_min_cameras: tuple[int, ...] = ()
    radius: float | None = None
    elevation_deg: float | None = None
    true_cameras: tuple[TrueCamera, ...] = ()


@dataclass(frozen=True)
class RigRecord:
    """How the sequences of a rig were generated: configuration, versions of packages and commit of the generator."""

    config: Mapping[str, Any]
    versions: Mapping[str, str]
    commit: str | None


@dataclass(frozen=True)
class Manifest:
    """One data set.

    rigs: by name. counts: numbers of sequences, frames and images by rig.
    """

    seed: int
    licence: str
    rigs: Mapping[str, RigRecord]
    counts: Mapping[str, Mapping[str, Any]]
    identities: tuple[IdentityEntry, ...]
    sequences: tuple[SequenceEntry, ...]


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
        UserError: no folder is given, one has no `dataset.json`, or that is damaged or of another format, or they list
            no sequence.
    """
    if not folders:
        raise UserError("missing", "dataset: no folder is given", "use dataset=DIR or dataset=[DIR,DIR]")
    parts = [read_manifest(folder) for folder in folders]
    sequences = tuple(sequence for part in parts for sequence in part.sequences)
    identities = tuple(identity for part in parts for identity in part.identities)
    if not sequences:
        raise UserError("missing", f"{folders[0] / MANIFEST}: lists no sequences", "generate some first")
    return DatasetEntries(tuple(folders), sequences, identities)


def read_manifest(folder: Path) -> Manifest:
    """Read the manifest of a data set.

    Raises:
        UserError: the folder has no `dataset.json`, or that is damaged or of another format.
    """
    return _read(folder / MANIFEST, lambda raw: _manifest(raw, folder))


def write_manifest(manifest: Manifest, folder: Path) -> None:
    """Write `dataset.json`, whole or not at all."""
    write_json(folder / MANIFEST, manifest_to_json(manifest, folder))


def read_sequence_entry(dataset: Path, folder: Path) -> SequenceEntry:
    """The entry that a finished sequence holds.

    Args:
        dataset: folder of the data set.
        folder: of the sequence.

    Raises:
        UserError: there is none, or it is damaged.
    """
    return _read(folder / ENTRY, lambda raw: _sequence(raw, dataset))


def write_sequence_entry(entry: SequenceEntry, dataset: Path, folder: Path) -> None:
    """Write a sequence's own entry into a folder, which is not `entry.folder` while the sequence is being made."""
    write_json(folder / ENTRY, sequence_to_json(entry, dataset))


def rig_from_json(raw: Mapping[str, Any]) -> RigRecord:
    """Inverse of `rig_to_json`."""
    return RigRecord(raw["config"], raw["versions"], raw["commit"])


def rig_to_json(rig: RigRecord) -> dict[str, Any]:
    """As the manifest and `rigs/<name>.json` have it."""
    return {"config": dict(rig.config), "versions": dict(rig.versions), "commit": rig.commit}


def manifest_to_json(manifest: Manifest, folder: Path) -> dict[str, Any]:
    """The content of `dataset.json`.

    Args:
        folder: of the data set, in which all its files lie.
    """
    return {
        "format": FORMAT,
        "version": VERSION,
        "seed": manifest.seed,
        "licence": manifest.licence,
        "rigs": {name: rig_to_json(rig) for name, rig in manifest.rigs.items()},
        "counts": {name: dict(counts) for name, counts in manifest.counts.items()},
        "identities": [_identity_to_json(identity, folder) for identity in manifest.identities],
        "sequences": [sequence_to_json(sequence, folder) for sequence in manifest.sequences],
    }


def sequence_to_json(entry: SequenceEntry, dataset: Path) -> dict[str, Any]:
    """As the manifest and `sequence.json` have it."""
    raw: dict[str, Any] = {
        "name": entry.name,
        "folder": entry.folder.relative_to(dataset).as_posix(),
        "class": entry.label,
        "identity": entry.identity,
        "split": entry.split,
        "rig": entry.rig,
        "frames": entry.frames,
        "fps": entry.fps,
        "cameras": entry.cameras,
        "distance_m": entry.distance,
        "objects": [{"id": index, "identity": name} for index, name in enumerate(entry.objects, start=1)],
        "frames_below_min_cameras": list(entry.frames_below_min_cameras),
    }
    optional = {"radius_m": entry.radius, "elevation_deg": entry.elevation_deg}
    raw |= {key: value for key, value in optional.items() if value is not None}
    if entry.true_cameras:
        raw["true_cameras"] = [
            {"name": camera.name, "K": camera.K.tolist(), "world_from_cam": camera.world_from_cam.tolist()}
            for camera in entry.true_cameras
        ]
    return raw


def _identity_to_json(entry: IdentityEntry, dataset: Path) -> dict[str, Any]:
    return {
        "name": entry.name,
        "class": entry.label,
        "family": entry.family,
        "split": entry.split,
        "asset": entry.asset.relative_to(dataset).as_posix(),
        "licence": entry.licence,
        "source": entry.source,
    }


def _read(path: Path, parse: Callable[[Any], _T]) -> _T:
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        raise UserError(
            "missing", f"{path}: does not exist", "generate the data set to its end, or correct dataset="
        ) from None
    except (ValueError, RecursionError):
        raise UserError("unreadable", f"{path}: is not valid JSON", _AGAIN) from None
    if path.name == MANIFEST and (not isinstance(raw, dict) or raw.get("format") != FORMAT):
        raise UserError("unreadable", f"{path}: format is not {FORMAT}", "name the folder of a generated data set")
    if path.name == MANIFEST and raw.get("version") != VERSION:
        raise UserError("unreadable", f"{path}: version is {raw.get('version')}, known is {VERSION}", _AGAIN)
    try:
        return parse(raw)
    except KeyError as error:
        raise UserError("missing", f"{path}: {error.args[0]} is missing", _AGAIN) from None
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise UserError("unreadable", f"{path}: has entries of another form ({error})", _AGAIN) from None


def _manifest(raw: Mapping[str, Any], folder: Path) -> Manifest:
    return Manifest(
        seed=raw["seed"],
        licence=raw["licence"],
        rigs={name: rig_from_json(rig) for name, rig in raw["rigs"].items()},
        counts=raw["counts"],
        identities=tuple(_identity(entry, folder) for entry in raw["identities"]),
        sequences=tuple(_sequence(entry, folder) for entry in raw["sequences"]),
    )


def _sequence(entry: Mapping[str, Any], dataset: Path) -> SequenceEntry:
    return SequenceEntry(
        folder=_inside(dataset, entry["folder"]),
        name=entry["name"],
        label=entry["class"],
        identity=entry["identity"],
        split=entry["split"],
        rig=entry["rig"],
        frames=entry["frames"],
        fps=float(entry["fps"]),
        objects=tuple(item["identity"] for item in entry["objects"]),
        cameras=entry["cameras"],
        distance=entry["distance_m"],
        frames_below_min_cameras=tuple(entry["frames_below_min_cameras"]),
        radius=entry.get("radius_m"),
        elevation_deg=entry.get("elevation_deg"),
        true_cameras=tuple(_true_camera(camera) for camera in entry.get("true_cameras", ())),
    )


def _inside(dataset: Path, relative: str) -> Path:
    """A path of the data set.

    Raises:
        ValueError: it is absolute or leads out of the folder.
    """
    if (
        PurePosixPath(relative).is_absolute()
        or PureWindowsPath(relative).anchor
        or ".." in re.split(r"[/\\]", relative)
    ):
        raise ValueError(f"the path {relative!r} leaves the data set's folder")
    return dataset / relative


def _true_camera(camera: Mapping[str, Any]) -> TrueCamera:
    return TrueCamera(camera["name"], np.array(camera["K"], float), np.array(camera["world_from_cam"], float))


def _identity(entry: Mapping[str, Any], dataset: Path) -> IdentityEntry:
    return IdentityEntry(
        name=entry["name"],
        label=entry["class"],
        family=entry["family"],
        split=entry["split"],
        asset=_inside(dataset, entry["asset"]),
        licence=entry["licence"],
        source=entry["source"],
    )
