"""The manifest of a data set: `dataset.json`, put together from what each sequence and each rig left on disk.

Every finished sequence holds its entry in `sequence.json`, and every rig its configuration in `rigs/<name>.json`, so
shards on several machines need no common file: whoever finds everything complete writes the manifest.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.simulate.assets.catalogue import Identity
from aerojax.simulate.plan.dataset import CampaignConfig, SequenceTask, cast_of, count, station_of, work_list
from aerojax.simulate.record import ASSET_LICENCE, ScenePlan
from aerojax.simulate.world.fixed_rigs import conditions

FORMAT, VERSION = "aerojax-dataset", 1
DATA_LICENCE = "CC-BY-4.0"
ENTRY, RIGS = "sequence.json", "rigs"


def sequence_entry(task: SequenceTask, config: CampaignConfig, plan: ScenePlan, capture: Capture) -> dict[str, Any]:
    """What `dataset.json` says about one sequence.

    `distance_m` is the mean over cameras and frames to the first object. `frames_below_min_cameras` lists the frames
    that fewer cameras saw than asked for. Where the written calibration or clocks are not ideal, `true_cameras` has
    the true ones.
    """
    first = capture.truth.objects[0] if capture.truth is not None else None
    seen = [sum(state.visible.values()) for state in first.frames] if first is not None else []
    station = station_of(config)
    condition = conditions(station)[task.condition] if station is not None else None
    entry: dict[str, Any] = {
        "name": task.name,
        "folder": task.folder,
        "class": task.identity.label,
        "identity": task.identity.name,
        "split": task.identity.split,
        "rig": config.rig.name,
        "frames": plan.frames,
        "fps": plan.fps,
        "cameras": len(plan.cameras),
        "distance_m": round(_distance(plan), 3),
        "objects": [{"id": i + 1, "identity": a.identity.name} for i, a in enumerate(plan.actors)],
        "frames_below_min_cameras": [f for f, cameras in enumerate(seen) if cameras < config.rig.min_cameras],
    }
    if condition is not None and condition.radius > 0:
        entry["radius_m"], entry["elevation_deg"] = condition.radius, condition.elevation_deg
    if any(_differs(true, told) for true, told in zip(plan.cameras, plan.calibration, strict=True)):
        entry["true_cameras"] = [_true_camera(camera) for camera in plan.cameras]
    return entry


def _distance(plan: ScenePlan) -> float:
    inside = slice(plan.margin, plan.margin + plan.frames)
    path = plan.actors[0].flight.position[inside]
    centres = np.stack([camera.world_from_cam[:3, 3] for camera in plan.cameras])
    return float(np.linalg.norm(path[:, None] - centres[None], axis=-1).mean())


def _differs(one: CaptureCamera, other: CaptureCamera) -> bool:
    return not (np.array_equal(one.world_from_cam, other.world_from_cam) and np.array_equal(one.K, other.K))


def _true_camera(camera: CaptureCamera) -> dict[str, Any]:
    return {"name": camera.name, "K": camera.K.tolist(), "world_from_cam": camera.world_from_cam.tolist()}


def config_mapping(config: CampaignConfig) -> dict[str, Any]:
    """The configuration as JSON has it; a list of models becomes its contents, wherever it lay."""
    plain = json.loads(json.dumps(to_mapping(config), default=str))
    if config.models is not None:
        plain["models"] = [identity.name for cast in cast_of(config).values() for identity in cast if identity.model]
    return plain


def begin_rig(dataset: Path, config: CampaignConfig, origin: Mapping[str, Any]) -> None:
    """Note the configuration of a rig in the data set, or find it to be the one that is there.

    Args:
        dataset: folder of the data set.
        config: what is going to be generated.
        origin: versions and commit of the generator.

    Raises:
        UserError: the folder holds sequences of this rig with another configuration.
    """
    path = dataset / RIGS / f"{config.rig.name}.json"
    plain = config_mapping(config)
    if path.is_file():
        before = json.loads(path.read_text())["config"]
        if before != plain:
            changed = ", ".join(sorted(key for key in {*before, *plain} if before.get(key) != plain.get(key)))
            raise UserError(
                "occupied", f"{path}: the folder holds this rig with another {changed}", "choose another folder"
            )
        return
    write_json(path, {"config": plain, **origin})


def complete(dataset: Path, tasks: tuple[SequenceTask, ...]) -> bool:
    """Whether every sequence of the list exists."""
    return all((dataset / task.folder / ENTRY).is_file() for task in tasks)


def build_manifest(dataset: Path, config: CampaignConfig) -> dict[str, Any]:
    """The content of `dataset.json`: this rig's sequences and those of other rigs that are in the folder."""
    tasks = work_list(config)
    rigs = {path.stem: json.loads(path.read_text()) for path in sorted((dataset / RIGS).glob("*.json"))}
    entries = [json.loads(path.read_text()) for path in sorted(dataset.glob(f"*/*/{ENTRY}"))]
    entries = [entry for entry in entries if entry["rig"] in rigs]
    cast = {identity.name: identity for everyone in cast_of(config).values() for identity in everyone}
    known = _known_identities(dataset) | {name: identity_entry(identity) for name, identity in cast.items()}
    used = {item["identity"] for entry in entries for item in entry["objects"]}
    return {
        "format": FORMAT,
        "version": VERSION,
        "seed": config.seed,
        "licence": DATA_LICENCE,
        "rigs": rigs,
        "counts": {config.rig.name: to_mapping(count(config, tasks))} | _other_counts(dataset, config.rig.name),
        "identities": [known[name] for name in sorted(used)],
        "sequences": entries,
    }


def _previous(dataset: Path) -> dict[str, Any]:
    path = dataset / "dataset.json"
    return json.loads(path.read_text()) if path.is_file() else {}


def _known_identities(dataset: Path) -> dict[str, dict[str, Any]]:
    return {item["name"]: item for item in _previous(dataset).get("identities", [])}


def _other_counts(dataset: Path, rig: str) -> dict[str, Any]:
    return {name: value for name, value in _previous(dataset).get("counts", {}).items() if name != rig}


def identity_entry(identity: Identity) -> dict[str, Any]:
    """What `dataset.json` says about an identity."""
    model = identity.model
    licence, source = (ASSET_LICENCE, "aerojax") if model is None else (model.licence, model.source)
    return {
        "name": identity.name,
        "class": identity.label,
        "family": identity.family,
        "split": identity.split,
        "asset": f"assets/{identity.name}.usdc",
        "licence": licence or "unknown",
        "source": source or "the user's own model",
    }


def json_text(content: Any) -> str:
    """JSON as all files of a data set have it."""
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def sha256_of(text: str) -> str:
    """SHA-256 of a file with this text, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def write_json(path: Path, content: Any) -> None:
    """Write JSON in one step; a reader never sees half of it."""
    write_text(path, json_text(content))


def write_text(path: Path, text: str) -> None:
    """Write a file in one step, also where several processes write the same file at once."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    Path(temporary).chmod(0o644)
    Path(temporary).replace(path)
