"""Everything that is said about data sets, as one value and as JSON."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from aerojax.data.manifest import DatasetEntries
from aerojax.evaluate.dataset_qa.balance import Composition, compositions
from aerojax.evaluate.dataset_qa.consistency import Consistency, consistency
from aerojax.evaluate.dataset_qa.coverage import area_histogram, distance_histogram, heat_map, visibility_curve
from aerojax.evaluate.dataset_qa.leakage import Embedded, Leakage, leakage
from aerojax.evaluate.dataset_qa.motion import ClassMotion, Motion, class_motions
from aerojax.evaluate.dataset_qa.observations import Observations


@dataclass(frozen=True, eq=False)
class Coverage:
    """Figures 6.1 to 6.4 of one rig; see `dataset_coverage`. heat: by camera, in the rig's order."""

    rig: str
    heat: tuple[Float[np.ndarray, "rows columns"], ...]
    areas: Int[np.ndarray, "label bin"]
    distances: Int[np.ndarray, "label distance"]
    visibility: Float[np.ndarray, "cameras"]


@dataclass(frozen=True, eq=False)
class Description:
    """What is known of the data sets in `folders`; identities' motions and classes' means of them."""

    folders: tuple[str, ...]
    compositions: tuple[Composition, ...]
    consistency: tuple[Consistency, ...]
    coverage: tuple[Coverage, ...]
    motions: tuple[Motion, ...]
    class_motions: tuple[ClassMotion, ...]
    leakage: Leakage


def describe(
    entries: DatasetEntries, observations: Observations, shapes: Sequence[Embedded], motions: Sequence[Motion]
) -> Description:
    """Put a description together.

    Args:
        entries: the manifests.
        observations: of the sequences that were read; their `sequence` is an index into `entries.sequences`.
        shapes, motions: of the identities.

    Raises:
        UserError: an asset cannot be read.
    """
    rig_of = np.array([entries.rigs.index(sequence.rig) for sequence in entries.sequences])
    by_rig = {rig: observations.where(rig_of[observations.sequence] == i) for i, rig in enumerate(entries.rigs)}
    return Description(
        folders=tuple(folder.name for folder in entries.folders),
        compositions=compositions(entries.sequences),
        consistency=tuple(consistency(rig, views) for rig, views in by_rig.items()),
        coverage=tuple(_coverage(rig, views) for rig, views in by_rig.items()),
        motions=tuple(motions),
        class_motions=class_motions(motions),
        leakage=leakage(entries, shapes),
    )


def _coverage(rig: str, views: Observations) -> Coverage:
    cameras = range(int(views.camera.max(initial=-1)) + 1)
    heat = tuple(heat_map(views.where(views.camera == camera)) for camera in cameras)
    return Coverage(rig, heat, area_histogram(views), distance_histogram(views), visibility_curve(views))


def to_json(value: Any) -> Any:
    """Dataclasses, arrays and tuples as JSON has them; what is not finite becomes null."""
    if dataclasses.is_dataclass(value):
        return {field.name: to_json(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return to_json(value.tolist())
    if isinstance(value, list | tuple):
        return [to_json(item) for item in value]
    if isinstance(value, float):
        return round(value, 6) if math.isfinite(value) else None
    return value
