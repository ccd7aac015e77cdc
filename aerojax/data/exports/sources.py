"""What is exported: the sequences of a data set, names that any tool can take, and ids that never change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from aerojax.capture.format import Capture
from aerojax.capture.paths import distinct_names
from aerojax.core.errors import UserError
from aerojax.core.seeds import number_of

Placement = Literal["copy", "hardlink", "symlink"]
ReplicatorLayout = Literal["nested", "flat"]
UNSPLIT = "all"
"""Name of the split that captures without splits are exported as."""

_ID_BITS = 52
"""Ids pass through JavaScript and through float64 arrays (pycocotools' matches) unharmed; 0 is left out."""


@dataclass(frozen=True)
class ExportOptions:
    """Choices that all formats share.

    images: how unchanged images come into the export; those of a lens or a video are undistorted and written anew.
    depth: write depth maps where the format has them and the capture too.
    replicator_layout: `nested` has a folder an annotator below each camera, as Replicator writes for several render
        products; `flat` puts all files of a camera into one folder, as it does for a single one.
    """

    images: Placement = "copy"
    depth: bool = True
    replicator_layout: ReplicatorLayout = "nested"


@dataclass(frozen=True)
class SourceSequence:
    """One capture of a data set; `split` and `name` are safe as file names."""

    split: str
    name: str
    folder: Path


@dataclass(frozen=True)
class ExportFormat:
    """A format: what it writes for one sequence, and what it adds when all are written.

    write_sequence: (capture, sequence, folder of the export, options) to a JSON-ready part.
    finish: (folder of the export, files of the parts in order of split and name).
    """

    write_sequence: Callable[[Capture, SourceSequence, Path, ExportOptions], dict[str, Any]]
    finish: Callable[[Path, Sequence[Path]], None]


def find_sequences(dataset: Path) -> tuple[SourceSequence, ...]:
    """Sequences of a generated data set, of a folder of captures, or one capture; sorted by split and name.

    Names that would be the same once they are safe are told apart by a hash.

    Raises:
        UserError: there is none.
    """
    folders = [dataset]
    if not (dataset / "capture.json").is_file():
        inner = [file.parent for depth in ("*", "*/*") for file in dataset.glob(f"{depth}/capture.json")]
        # A hidden folder is a sequence that is still being written.
        folders = sorted(folder for folder in inner if not folder.name.startswith("."))
    if not folders:
        raise UserError(
            "missing", f"dataset={dataset} holds no capture.json", "name a data set, a folder of captures or a capture"
        )
    by_split: dict[str, list[Path]] = {}
    for folder in folders:
        below = folder == dataset or folder.parent == dataset
        by_split.setdefault("" if below else folder.parent.name, []).append(folder)
    named = [split for split in by_split if split]
    splits = {"": UNSPLIT} | dict(zip(named, distinct_names(named), strict=True))
    found = [
        SourceSequence(splits[split], name, folder)
        for split, members in by_split.items()
        for folder, name in zip(members, distinct_names([f.resolve().name for f in members]), strict=True)
    ]
    return tuple(sorted(found, key=lambda sequence: (sequence.split, sequence.name)))


def camera_names(capture: Capture) -> tuple[str, ...]:
    """Safe names of a capture's cameras, all different."""
    return distinct_names([camera.name for camera in capture.cameras])


def stable_id(*parts: object) -> int:
    """A positive id of 52 bits that depends on `parts` alone, not on order, run or size of the data set."""
    return number_of(*parts) % (2**_ID_BITS - 1) + 1


def require_no_skew(capture: Capture, format_name: str) -> None:
    """Refuse a capture whose cameras the format cannot express.

    Raises:
        UserError: a camera has skew.
    """
    for camera in capture.cameras:
        if camera.K[0, 1] != 0:
            message = f"{capture.folder}/capture.json: camera {camera.name} has skew in K, which {format_name} has not"
            raise UserError("invalid", f"{message}", "export another format or resample the images")
