"""Which files of a folder of Gaussians are frames of which sequence: the released data layouts and any folder of PLYs.

Preprocessed: `{train,val,test}.json` list `split/class id/NAME_frame_NNNN[_sK].pt`; `category.txt` has `id,name` lines.
Otherwise: every `[NAME_]frame_NNNN[_sK].ply` (or raw `.pt`) below the folder, or `NAME12.ply`, `12.ply`: the last
digits are the frame's number, with zeros before them or without, from any number on and with gaps. NAME is the parent
folder's where the file has none, class and split are folders on the way, or given.
"""

from __future__ import annotations

import itertools
import json
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.splits import SPLITS

_FRAME = re.compile(r"^(?:(?P<name>.+)_)?frame_(?P<frame>\d+)(?:_s(?P<sweep>\d+))?$")
_NUMBERED = re.compile(r"^(?:frame|point_cloud|(?P<name>.*?))[ _.-]*(?P<frame>\d+)(?P<sweep>)$")
"""Any other name that ends in a number; two usual words say nothing of what is shown."""
_ASSETS = (re.compile(r"_lform_(.+)_custom_"), re.compile(r"_\d+(?:\.\d+)?x_(.+)$"))
"""Where a rendered sequence's name holds its asset: within a line formation's, or behind the speed."""


@dataclass(frozen=True)
class FrameSequence:
    """One clip to be: its name, class, asset, split and frame files in order of time.

    preprocessed: whether the files hold released, normalised versions and not plain Gaussians.
    """

    name: str
    label: str
    identity: str
    split: str
    files: tuple[Path, ...]
    preprocessed: bool


@dataclass(frozen=True)
class _Frame:
    file: Path
    asset: str
    sweep: int
    number: int
    label: str
    split: str
    place: str
    """Sequences of different places are different."""


def find_sequences(source: Path, *, label: str | None = None, split: str | None = None) -> tuple[FrameSequence, ...]:
    """The sequences of a folder, by class, asset and sweep.

    Args:
        source: folder in one of the layouts of this module.
        label, split: of all sequences, for folders whose paths do not say; a preprocessed folder says both itself.

    Raises:
        UserError: `label` is no class; else names every file whose name, class or split cannot be told, every listed
            file that is absent, every frame that is there twice and every asset in two splits.
    """
    if label not in (None, *CLASSES):
        raise UserError("out-of-range", f"label {label!r} is no class", f"choose one of {', '.join(CLASSES)}")
    if not source.is_dir():
        raise UserError("unreadable", f"source {source} is not a folder", "correct the path")
    problems: list[str] = []
    preprocessed = any((source / f"{part}.json").is_file() for part in SPLITS)
    found = _listed(source, problems) if preprocessed else _below(source, label, split, problems)
    groups: dict[tuple, list[_Frame]] = defaultdict(list)
    for frame in found:
        groups[(frame.split, frame.label, frame.place, frame.asset, frame.sweep)].append(frame)
    sequences = [_sequence(sorted(group, key=lambda f: f.number), preprocessed, problems) for group in groups.values()]
    sequences.sort(key=lambda s: (s.split, s.name))
    problems += _collisions(sequences)
    if not problems and not sequences:
        problems.append("no frames (NAME_frame_NNNN.ply, or .pt with train.json, val.json, test.json)")
    if problems:
        raise UserError("invalid", f"{source} cannot be imported:\n  " + "\n  ".join(problems))
    return tuple(sequences)


def asset_of(name: str) -> str:
    """The asset that a rendered sequence's name holds; the whole name where it holds none."""
    found = (pattern.search(name) for pattern in _ASSETS)
    return next((match[1] for match in found if match), name)


def _listed(source: Path, problems: list[str]) -> Iterator[_Frame]:
    classes = _categories(source / "category.txt", problems)
    for split in SPLITS:
        for entry in _entries(source / f"{split}.json", problems):
            path = PurePosixPath(entry)
            match = _FRAME.match(path.stem)
            label = classes.get(path.parts[1]) if len(path.parts) == 3 else None
            if not match or not match["name"] or path.suffix != ".pt" or len(path.parts) != 3 or ".." in path.parts:
                problems.append(f"{split}.json: {entry!r} is not split/class/NAME_frame_NNNN.pt")
            elif path.parts[0] != split or label is None:
                problems.append(f"{split}.json: {entry!r} has another split, or a class that category.txt lacks")
            elif not (source / path).is_file():
                problems.append(f"{split}.json: {entry!r} does not exist; fetch it, or leave it out of the list")
            else:
                numbers = int(match["sweep"] or 0), int(match["frame"])
                yield _Frame(source / path, match["name"], *numbers, label, split, "")


def _entries(path: Path, problems: list[str]) -> list[str]:
    """The paths of a split's list; a split that has no list has no frames."""
    if not path.is_file():
        return []
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        content = error
    if not isinstance(content, list) or not all(isinstance(entry, str) for entry in content):
        problems.append(f"{path.name} is not a JSON list of paths")
        return []
    return content


def _categories(path: Path, problems: list[str]) -> Mapping[str, str]:
    """Class by the id that folders are named after; the released order where the file is absent."""
    if not path.is_file():
        return {str(index): name for index, name in enumerate(CLASSES)}
    classes = {}
    for line in filter(None, (line.strip() for line in path.read_text(encoding="utf-8").splitlines())):
        number, _, name = (part.strip() for part in line.partition(","))
        if name not in CLASSES:
            problems.append(f"category.txt: {line!r} is not `id,name` with a name of {', '.join(CLASSES)}")
        classes[number] = name
    return classes


def _below(source: Path, label: str | None, split: str | None, problems: list[str]) -> Iterator[_Frame]:
    for path in sorted(p for p in source.rglob("*") if p.suffix in (".ply", ".pt") and p.is_file()):
        place = path.relative_to(source).parent
        match = _FRAME.match(path.stem) or _NUMBERED.match(path.stem)
        steps = [source.name, *place.parts]
        which = label or next((part for part in reversed(steps) if part in CLASSES), None)
        part = split or next((part for part in reversed(steps) if part in SPLITS), None)
        if match is None:
            problems.append(f"{path}: the name ends in no number of a frame")
        if which is None:
            problems.append(f"{path}: no folder on its way is a class ({', '.join(CLASSES)}); set label")
        if part is None:
            problems.append(f"{path}: no folder on its way is a split ({', '.join(SPLITS)}); set split")
        if match and which and part:
            numbers = int(match["sweep"] or 0), int(match["frame"])
            yield _Frame(path, match["name"] or path.parent.name, *numbers, which, part, str(place))


def _sequence(frames: list[_Frame], preprocessed: bool, problems: list[str]) -> FrameSequence:
    for earlier, later in itertools.pairwise(frames):
        if earlier.number == later.number:
            problems.append(f"{later.file}: frame {later.number} is there twice, also in {earlier.file}")
    first = frames[0]
    name = re.sub(r"[^\w.+-]", "_", f"{first.label}_{first.asset}_s{first.sweep}")
    files = tuple(frame.file for frame in frames)
    return FrameSequence(name, first.label, asset_of(first.asset), first.split, files, preprocessed)


def _collisions(sequences: list[FrameSequence]) -> list[str]:
    problems, splits, names = [], defaultdict(set), defaultdict(list)
    for sequence in sequences:
        splits[sequence.label, sequence.identity].add(sequence.split)
        names[sequence.split, sequence.name].append(str(sequence.files[0].parent))
    for (label, identity), found in splits.items():
        if len(found) > 1:
            problems.append(f"{label} {identity} is in {' and '.join(sorted(found))}; an asset belongs to one split")
    for (split, name), places in names.items():
        if len(places) > 1:
            problems.append(f"{split} has several sequences {name}, in {', '.join(places)}; rename or import apart")
    return problems
