"""A folder or a stream of factory clips, made by worker processes: the same clips however many there are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from aerojax.core.claims import claim
from aerojax.core.config import to_mapping
from aerojax.core.types import CLASSES
from aerojax.core.workers import run_in_order, run_jobs
from aerojax.data.clips import RECORD, StoredClip, save_clip
from aerojax.pipeline.factory.clips import clips_of
from aerojax.pipeline.factory.config import FactoryConfig
from aerojax.pipeline.factory.plan import clip_name, rig_kind
from aerojax.simulate.assets.catalogue import Identity, identities, outliers, training_individual

FREE = ("catalogue", "split", "individuals", "clips")
"""What may differ between clips that share a folder."""
OUTLIERS = "outliers_"
"""Before the split in the name of a folder of outliers."""


@dataclass(frozen=True)
class MadeFactoryClips:
    """What a run left: clips by `rig/split`, how many of them are new, and the names of those that were given up."""

    counts: dict[str, int]
    new: int
    unusable: tuple[str, ...]


@dataclass(frozen=True)
class _Job:
    identity: Identity
    indices: tuple[int, ...]
    config: FactoryConfig
    folder: Path | None = None


def individuals_of(config: FactoryConfig) -> tuple[Identity, ...]:
    """Who flies, classes in turn; a larger number extends the list.

    In the training split first one individual a family, then mixtures of them; in the others further draws of their
    own families. Outliers are never learnt from, so they have no training split.

    Raises:
        UserError: there are no outliers of the split.
    """
    if config.catalogue == "outliers":
        return outliers(config.split, config.individuals)
    if config.split != "train":
        return identities(config.split, config.individuals)
    published = {label: [one for one in identities("train") if one.label == label] for label in CLASSES}
    return tuple(
        published[label][number] if number < len(published[label]) else _mixture(label, number - len(published[label]))
        for number in range(config.individuals)
        for label in CLASSES
    )


def _mixture(label: str, number: int) -> Identity:
    return training_individual(label, number)


def clip_path(folder: Path, identity: Identity, index: int, config: FactoryConfig) -> Path:
    """Where a clip lies: `<folder>/<rig>/<split>/<name>.npz`, an outlier's in `outliers_<split>`."""
    name = clip_name(identity, index)
    part = OUTLIERS + config.split if config.catalogue == "outliers" else config.split
    return folder / rig_kind(config, name) / part / f"{name}.npz"


def make_factory_clips(
    config: FactoryConfig, folder: Path, *, workers: int, progress: Callable[[int, int, str], None]
) -> MadeFactoryClips:
    """Make every clip that is not there yet.

    A clip exists whole or not at all and depends on its name and the configuration alone, so a killed run goes on where
    it stopped and the number of workers changes nothing. Splits, and more individuals or clips, may share a folder.

    Args:
        config: decides every byte of a clip.
        folder: of the clips; `<folder>/<rig>` is what `load_clips` and `settings_of` take.
        workers: processes.
        progress: called after each individual with (done, total, what) in clips.

    Raises:
        UserError: the folder holds clips of another configuration.
    """
    claim(folder / RECORD, to_mapping(config), ignoring=FREE)
    everything = [(one, index) for one in individuals_of(config) for index in range(config.clips)]
    jobs = []
    for one in individuals_of(config):
        missing = [i for i in range(config.clips) if not clip_path(folder, one, i, config).exists()]
        if missing:
            jobs.append(_Job(one, tuple(missing), config, folder))
    total, done, unusable = sum(len(job.indices) for job in jobs), 0, []
    progress(0, total, f"clips in {folder}")
    for tried, names in run_jobs(_write, jobs, workers=workers):
        unusable += names
        done += tried
        progress(done, total, f"clips in {folder}")
    paths = (clip_path(folder, one, index, config) for one, index in everything)
    counts = Counter(str(path.parent.relative_to(folder)) for path in paths if path.exists())
    return MadeFactoryClips(dict(sorted(counts.items())), total - len(unusable), tuple(sorted(unusable)))


def clip_stream(config: FactoryConfig, *, workers: int = 1) -> Iterator[StoredClip]:
    """The same clips without a disk, individual by individual; no more are made ahead than a few a worker.

    Args:
        config: decides every clip.
        workers: processes; more change neither the clips nor their order.
    """
    jobs = (_Job(one, tuple(range(config.clips)), config) for one in individuals_of(config))
    for clips in run_in_order(_collect, jobs, workers=workers):
        yield from clips


def _write(job: _Job) -> tuple[int, list[str]]:
    """Save an individual's clips; how many were tried, and the names of those that were given up."""
    assert job.folder is not None
    unusable = []
    for index, (name, clip) in zip(job.indices, clips_of(job.identity, job.indices, job.config), strict=True):
        if clip is None:
            unusable.append(name)
            continue
        path = clip_path(job.folder, job.identity, index, job.config)
        images = {"crops": clip.crops, "crop_valid": clip.crop_valid, "facts": clip.facts, "classes": clip.classes}
        save_clip(path, clip.columns, clip.label, clip.identity, **images)
    return len(job.indices), unusable


def _collect(job: _Job) -> list[StoredClip]:
    return [clip for _, clip in clips_of(job.identity, job.indices, job.config) if clip is not None]
