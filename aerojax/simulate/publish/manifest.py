"""What a data set's manifest says, put together from what each sequence and each rig left on disk.

Every finished sequence holds its entry in `sequence.json`, and every rig its configuration in `rigs/<name>.json`, so
shards on several machines need no common file: whoever finds everything complete writes the manifest.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.core.claims import check_claim, claimed, plain
from aerojax.core.config import to_mapping
from aerojax.core.files import write_json
from aerojax.core.provenance import commit, package_versions
from aerojax.data.manifest import (
    ENTRY,
    MANIFEST,
    IdentityEntry,
    Manifest,
    RigRecord,
    SequenceEntry,
    TrueCamera,
    read_manifest,
    read_sequence_entry,
    rig_from_json,
    rig_to_json,
)
from aerojax.simulate.assets.catalogue import Identity
from aerojax.simulate.plan.dataset import (
    DatasetConfig,
    SequenceTask,
    count,
    fixed_rig,
    identities_by_split,
    work_list,
)
from aerojax.simulate.plan.scene import ASSET_LICENCE, ScenePlan
from aerojax.simulate.world.fixed_rigs import conditions

DATA_LICENCE = "CC-BY-4.0"
RIGS = "rigs"
"""Folder of the rigs' configurations in a data set."""


def sequence_entry(
    task: SequenceTask, config: DatasetConfig, plan: ScenePlan, capture: Capture, dataset: Path
) -> SequenceEntry:
    """What the manifest says about one sequence.

    Args:
        task: which sequence.
        config: of the data set.
        plan: what was recorded.
        capture: as it was recorded; the folder may be another one than the sequence's own.
        dataset: folder of the data set.
    """
    first = capture.truth.objects[0] if capture.truth is not None else None
    seen = [sum(state.visible.values()) for state in first.frames] if first is not None else []
    fixed = fixed_rig(config)
    condition = conditions(fixed)[task.condition] if fixed is not None else None
    if condition is not None and condition.radius == 0:
        condition = None  # a line has none
    wrong = any(_differs(true, told) for true, told in zip(plan.cameras, plan.calibration, strict=True))
    return SequenceEntry(
        folder=dataset / task.folder,
        name=task.name,
        label=task.identity.label,
        identity=task.identity.name,
        split=task.identity.split,
        rig=config.rig.name,
        frames=plan.frames,
        fps=plan.fps,
        objects=tuple(flown.identity.name for flown in plan.objects),
        cameras=len(plan.cameras),
        distance=round(_distance(plan), 3),
        frames_below_min_cameras=tuple(f for f, cameras in enumerate(seen) if cameras < config.rig.min_cameras),
        radius=None if condition is None else condition.radius,
        elevation_deg=None if condition is None else condition.elevation_deg,
        true_cameras=tuple(TrueCamera(c.name, c.K, c.world_from_cam) for c in plan.cameras) if wrong else (),
    )


def _distance(plan: ScenePlan) -> float:
    path = plan.shown(plan.objects[0].flight).position
    centres = np.stack([camera.world_from_cam[:3, 3] for camera in plan.cameras])
    return float(np.linalg.norm(path[:, None] - centres[None], axis=-1).mean())


def _differs(one: CaptureCamera, other: CaptureCamera) -> bool:
    return not (np.array_equal(one.world_from_cam, other.world_from_cam) and np.array_equal(one.K, other.K))


def begin_rig(dataset: Path, config: DatasetConfig) -> None:
    """Note how a rig is generated in the data set, or find that its configuration is the one that is there.

    Raises:
        UserError: the folder holds sequences of this rig with another configuration.
    """
    path = dataset / RIGS / f"{config.rig.name}.json"
    values = _values(config)
    noted = claimed(path)
    if noted is None:
        write_json(path, rig_to_json(RigRecord(values, package_versions(), commit())))
    else:
        check_claim(path, rig_from_json(noted).config, values)


def _values(config: DatasetConfig) -> dict[str, Any]:
    """The configuration as JSON has it; a list of models becomes its contents, wherever it lay."""
    values = plain(to_mapping(config))
    if config.models is not None:
        everyone = (identity for split in identities_by_split(config).values() for identity in split)
        values["models"] = [identity.name for identity in everyone if identity.model]
    return values


def complete(dataset: Path, tasks: tuple[SequenceTask, ...]) -> bool:
    """Whether every sequence of the list exists."""
    return all((dataset / task.folder / ENTRY).is_file() for task in tasks)


def build_manifest(dataset: Path, config: DatasetConfig) -> Manifest:
    """The manifest of this rig's sequences and of those of other rigs that are in the folder."""
    rigs = {path.stem: rig_from_json(json.loads(path.read_text())) for path in sorted((dataset / RIGS).glob("*.json"))}
    entries = (read_sequence_entry(dataset, path.parent) for path in sorted(dataset.glob(f"*/*/{ENTRY}")))
    sequences = tuple(entry for entry in entries if entry.rig in rigs)
    before = read_manifest(dataset) if (dataset / MANIFEST).is_file() else None
    known = {} if before is None else {entry.name: entry for entry in before.identities}
    for split in identities_by_split(config).values():
        known |= {identity.name: identity_entry(identity, dataset) for identity in split}
    others = {} if before is None else {name: n for name, n in before.counts.items() if name != config.rig.name}
    return Manifest(
        seed=config.seed,
        licence=DATA_LICENCE,
        rigs=rigs,
        counts={config.rig.name: to_mapping(count(config, work_list(config)))} | others,
        identities=tuple(known[name] for name in sorted({name for entry in sequences for name in entry.objects})),
        sequences=sequences,
    )


def identity_entry(identity: Identity, dataset: Path) -> IdentityEntry:
    """What the manifest says about an identity."""
    model = identity.model
    licence, source = (ASSET_LICENCE, "aerojax") if model is None else (model.licence, model.source)
    return IdentityEntry(
        name=identity.name,
        label=identity.label,
        family=identity.family,
        split=identity.split,
        asset=dataset / "assets" / f"{identity.name}.usdc",
        licence=licence or "unknown",
        source=source or "the user's own model",
    )
