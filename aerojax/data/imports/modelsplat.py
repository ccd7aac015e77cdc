"""ModelSplat: the objects of ModelNet as Gaussians (ShapeSplat; Ma et al. 2025), as clips of single frames.

Objects lie in `<root>/<class>/<train|test>/<class>_<number>/point_cloud.ply`, and the official lists
`modelnet10_train`, `modelnet10_test`, `modelnet40_train` and `modelnet40_test` (`.txt`) name one a line. Of every
training object several random subsets are kept, as the published recipe does: they lie in the clip where other clips
have their frames, so that training with windows of one frame draws another one in every epoch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float32, Key

from aerojax.core.config import require_at_least
from aerojax.core.errors import UserError
from aerojax.core.seeds import number_of
from aerojax.core.types import Gaussians
from aerojax.data.imports.each_clip import ImportedClips, import_each
from aerojax.data.imports.released_frames import decimated_columns, read_gaussians
from aerojax.data.splits import Split
from aerojax.gaussians.decimate import DecimationConfig

MODELNET_10 = (
    *("bathtub", "bed", "chair", "desk", "dresser"),
    *("monitor", "night_stand", "sofa", "table", "toilet"),
)
MODELNET_40 = (
    *("airplane", "bathtub", "bed", "bench", "bookshelf", "bottle", "bowl", "car", "chair", "cone"),
    *("cup", "curtain", "desk", "door", "dresser", "flower_pot", "glass_box", "guitar", "keyboard", "lamp"),
    *("laptop", "mantel", "monitor", "night_stand", "person", "piano", "plant", "radio", "range_hood", "sink"),
    *("sofa", "stairs", "stool", "table", "tent", "toilet", "tv_stand", "vase", "wardrobe", "xbox"),
)
"""Class names in the order of their numbers (Wu et al. 2015): the alphabet's."""
CLASSES_OF = {"modelnet10": MODELNET_10, "modelnet40": MODELNET_40}
FILE = "point_cloud.ply"


@dataclass(frozen=True)
class ObjectReading:
    """How an object's Gaussians become a clip.

    subset: of ModelNet.
    versions: random subsets of a training object; those of the other splits have one.
    validation: share of the training objects that choose the weights instead, by a hash of their names.
    decimation: of each subset.
    """

    subset: Literal["modelnet10", "modelnet40"] = "modelnet10"
    versions: int = 25
    validation: float = 0.1
    decimation: DecimationConfig = field(default_factory=DecimationConfig)

    def __post_init__(self) -> None:
        """Refuse what leaves no clips.

        Raises:
            UserError: names the field and the values that work.
        """
        require_at_least(self, "versions")
        if not 0 <= self.validation < 1:
            raise UserError("out-of-range", f"validation is {self.validation}", "it is a share, at least 0 and below 1")


@dataclass(frozen=True)
class SplatObject:
    """One object: its file, name and class, and the split that it is part of."""

    file: Path
    name: str
    label: str
    split: Split

    @property
    def identity(self) -> str:
        """Every object is an individual."""
        return self.name


def find_objects(root: Path, reading: ObjectReading, *, lists: Path | None = None) -> tuple[SplatObject, ...]:
    """The objects of a subset, sorted by name.

    Args:
        root: with a folder a class.
        reading: the subset and the share for validation.
        lists: folder of the official lists; without them the folders say what is there.

    Raises:
        UserError: there is none, or a list is missing or names what is not there.
    """
    found = []
    for part in ("train", "test"):
        names = _listed(lists, reading.subset, part) if lists is not None else _present(root, reading.subset, part)
        for name in names:
            label = name.rpartition("_")[0]
            if label not in CLASSES_OF[reading.subset]:
                raise UserError(
                    "invalid", f"{name!r} is of no class of {reading.subset}", "give the lists of the subset"
                )
            file = root / label / part / name / FILE
            found.append(SplatObject(file, name, label, _split(name, part, reading)))
    missing = [str(one.file) for one in found if not one.file.is_file()]
    if missing or not found:
        named = ", ".join(missing[:3]) or f"{root}/<class>/<train|test>/<object>/{FILE}"
        raise UserError(
            "missing", f"{len(missing) or 'all'} objects of {reading.subset} are missing: {named}", "unpack them"
        )
    return tuple(sorted(found, key=lambda one: one.name))


def _listed(lists: Path, subset: str, part: str) -> list[str]:
    path = lists / f"{subset}_{part}.txt"
    if not path.is_file():
        raise UserError("missing", f"{path} is missing", "give the folder of the official lists, or none")
    return path.read_text(encoding="utf-8").split()


def _present(root: Path, subset: str, part: str) -> list[str]:
    return [file.parent.name for label in CLASSES_OF[subset] for file in (root / label / part).glob(f"*/{FILE}")]


def _split(name: str, part: str, reading: ObjectReading) -> Split:
    if part == "test":
        return "test"
    return "val" if number_of("validation", name) % 2**32 < reading.validation * 2**32 else "train"


def in_unit_ball(columns: Float32[np.ndarray, "gaussian 14"]) -> Float32[np.ndarray, "gaussian 14"]:
    """An object in the unit ball about the mean of its Gaussians; the whole of it is made smaller, scales too."""
    centred = columns[:, :3] - columns[:, :3].mean(axis=0, dtype=np.float64)
    radius = max(float(np.linalg.norm(centred, axis=1).max()), 1e-12)
    placed = np.concatenate([centred, columns[:, 3:]], axis=1)
    placed[:, [0, 1, 2, 7, 8, 9]] /= radius
    return placed.astype(np.float32)


def object_columns(
    gaussians: Gaussians, versions: int, config: DecimationConfig, *, key: Key[Array, ""]
) -> Float32[np.ndarray, "version token 14"]:
    """Random subsets of an object in the unit ball about the mean of all its Gaussians."""
    unit = Gaussians.from_columns(jnp.asarray(in_unit_ball(np.asarray(gaussians.columns(), np.float32))))
    return np.stack([decimated_columns(unit, config, one) for one in jax.random.split(key, versions)])


def import_objects(
    objects: Sequence[SplatObject],
    reading: ObjectReading,
    folder: Path,
    *,
    source: Path,
    seed: int,
    progress: Callable[[int, int, str], None],
) -> ImportedClips:
    """Write the clips that are missing, `<folder>/<split>/<object>.npz`.

    Args:
        objects: of `find_objects(source, reading)`.
        reading: how files become clips.
        folder: of the clips.
        source: where the objects are; noted with the clips.
        seed: of the decimation.
        progress: called after each object with (done, total, what).

    Raises:
        UserError: the folder holds clips of another source or configuration.
    """

    def columns(one: SplatObject) -> np.ndarray:
        key = jax.random.key(number_of(seed, one.name) % 2**31)
        versions = reading.versions if one.split == "train" else 1
        return object_columns(read_gaussians(one.file), versions, reading.decimation, key=key)

    classes = CLASSES_OF[reading.subset]
    return import_each(objects, columns, reading, folder, source=source, seed=seed, progress=progress, classes=classes)
