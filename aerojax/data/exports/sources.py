"""What is exported: the sequences of a data set, names that any tool can take, and ids that never change."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from aerojax.capture.format import Capture
from aerojax.capture.paths import safe_name
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

    Raises:
        UserError: there is none, or two would have one name in the export.
    """
    found = [SourceSequence(UNSPLIT, safe_name(dataset.resolve().name), dataset)]
    if not (dataset / "capture.json").is_file():
        inner = [file.parent for depth in ("*", "*/*") for file in dataset.glob(f"{depth}/capture.json")]
        # A hidden folder is a sequence that is still being written.
        found = [_sequence(dataset, folder) for folder in inner if not folder.name.startswith(".")]
    if not found:
        raise UserError(
            "missing", f"dataset={dataset} holds no capture.json", "name a data set, a folder of captures or a capture"
        )
    found.sort(key=lambda sequence: (sequence.split, sequence.name))
    for one, other in itertools.pairwise(found):
        if (one.split, one.name) == (other.split, other.name):
            message = f"{one.folder} and {other.folder} would both be exported as {one.split}/{one.name}"
            raise UserError("invalid", f"{message}", "rename one of them")
    return tuple(found)


def _sequence(dataset: Path, folder: Path) -> SourceSequence:
    split = UNSPLIT if folder.parent == dataset else safe_name(folder.parent.name)
    return SourceSequence(split, safe_name(folder.name), folder)


def camera_names(capture: Capture) -> tuple[str, ...]:
    """Safe names of a capture's cameras.

    Raises:
        UserError: two cameras would have the same one.
    """
    names = tuple(safe_name(camera.name) for camera in capture.cameras)
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UserError(
            "mismatch", f"{capture.folder}/capture.json: cameras would share the file name {twice[0]!r}", "rename one"
        )
    return names


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
