"""A folder of scenes for training reconstructors, made by worker processes: the same scenes however many there are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from aerojax.core.claims import claim
from aerojax.core.config import to_mapping
from aerojax.core.workers import run_jobs
from aerojax.data.views import RECORD, save_views, stacked
from aerojax.pipeline.factory.views import ViewsConfig, objects_of, scenes_of
from aerojax.simulate.assets.catalogue import Identity

SHARD = 16
"""Objects of a file: what a killed worker loses at most."""


@dataclass(frozen=True)
class MadeViews:
    """What a run left: scenes that are new, and of how many objects the folder has all that are usable."""

    new: int
    objects: int


@dataclass(frozen=True)
class _Job:
    path: Path
    objects: tuple[Identity, ...]
    config: ViewsConfig


def shard_path(folder: Path, number: int, config: ViewsConfig) -> Path:
    """Where shard `number` of a split lies."""
    return folder / config.split / f"views_{number:05d}.npz"


def make_views(
    config: ViewsConfig, folder: Path, *, workers: int, progress: Callable[[int, int, str], None]
) -> MadeViews:
    """Make every shard that is not there yet; only whole ones, so the number of objects is rounded up.

    A shard depends on its number and the configuration alone. Splits, and more objects, may share a folder.

    Args:
        config: decides every byte.
        folder: of the scenes; `<folder>/<split>` is what `load_views` takes.
        workers: processes.
        progress: called after each shard with (done, total, what) in objects.

    Raises:
        UserError: the folder holds scenes of another configuration.
    """
    claim(folder / RECORD, to_mapping(config), ignoring=("split", "objects"))
    shards = -(-config.objects // SHARD)
    everyone = objects_of(replace(config, objects=shards * SHARD))
    jobs = [
        _Job(shard_path(folder, number, config), everyone[number * SHARD : (number + 1) * SHARD], config)
        for number in range(shards)
    ]
    missing = [job for job in jobs if not job.path.exists()]
    new, what = 0, f"objects in {folder}"
    progress(0, SHARD * len(missing), what)
    for done, count in enumerate(run_jobs(_write, missing, workers=workers), start=1):
        new += count
        progress(SHARD * done, SHARD * len(missing), what)
    return MadeViews(new, SHARD * shards)


def _write(job: _Job) -> int:
    """Save a shard; how many scenes it has."""
    scenes = [scene for one in job.objects for scene in scenes_of(one, job.config)]
    save_views(job.path, stacked(scenes))
    return len(scenes)
