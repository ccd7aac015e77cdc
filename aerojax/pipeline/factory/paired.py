"""Clips at several levels of faults: the same individuals, flights, rigs and light, only the fault differs."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from aerojax.core.claims import claim
from aerojax.core.config import to_mapping
from aerojax.core.files import write_json
from aerojax.core.workers import run_jobs
from aerojax.data.clips import RECORD, load_clip, save_clip
from aerojax.pipeline.factory.clips import clip_of
from aerojax.pipeline.factory.config import FactoryConfig
from aerojax.pipeline.factory.levels import BASE, LevelsConfig, levels_of
from aerojax.pipeline.factory.plan import clip_name
from aerojax.pipeline.factory.write import individuals_of
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import Identity
from aerojax.simulate.usd.animated_mesh import AnimatedMesh


@dataclass(frozen=True)
class MadeLevels:
    """What a run left: how many clips are new, and the names of those that cannot be had, by the level's folder."""

    new: int
    undrawn: dict[str, tuple[str, ...]]


@dataclass(frozen=True)
class _Job:
    identity: Identity
    clips: int
    ideal: FactoryConfig
    levels: dict[str, FactoryConfig]
    margin: int
    folder: Path


def make_levels(
    config: LevelsConfig, folder: Path, *, workers: int, progress: Callable[[int, int, str], None]
) -> MadeLevels:
    """Make the clips of every level that are not there yet: `<folder>/<level>/<split>/<name>.npz`.

    A clip is drawn until the ideal one has enough usable frames, and then as often at every level: what a fault makes
    of it is what counts, also if that is nothing. A killed run goes on where it stopped.

    Args:
        config: decides every byte. More individuals, clips and levels may join a folder, slower clocks may not.
        folder: of the levels.
        workers: processes.
        progress: called after each individual with (done, total, what) in individuals.

    Raises:
        UserError: the folder holds clips of another configuration.
    """
    claim(
        folder / RECORD,
        {**to_mapping(config.factory), "margin": config.margin},
        ignoring=("catalogue", "individuals", "clips"),
    )
    levels = {level.folder: level.config for level in levels_of(config)}
    clips, margin = config.factory.clips, config.margin
    jobs = [_Job(one, clips, config.factory, levels, margin, folder) for one in individuals_of(config.factory)]
    what, done, new = f"individuals at {len(levels)} levels", 0, 0
    undrawn: dict[str, list[str]] = {name: [] for name in levels}
    progress(0, len(jobs), what)
    for done, (made, lacking) in enumerate(run_jobs(_make, jobs, workers=workers), start=1):
        new += made
        for level, names in lacking.items():
            undrawn[level] += names
        progress(done, len(jobs), what)
    return MadeLevels(new, {level: tuple(sorted(names)) for level, names in undrawn.items()})


def _make(job: _Job) -> tuple[int, dict[str, list[str]]]:
    """One individual at every level: how many clips are new, and the names of those that cannot be had, by level."""
    names = [clip_name(job.identity, index) for index in range(job.clips)]
    record = job.folder / "undrawn" / f"{job.identity.name}.json"
    known: dict[str, list[str]] = json.loads(record.read_text()) if record.is_file() else {}
    missing = [name for name in names for level in job.levels if not _settled(job, known, level, name)]
    if not missing:
        return 0, _asked(known, job, names)
    mesh, new = build_animated(job.identity), 0
    for name in dict.fromkeys(missing):
        new += _make_name(job, mesh, name, known)
    write_json(record, known)
    return new, _asked(known, job, names)


def _settled(job: _Job, known: Mapping[str, list[str]], level: str, name: str) -> bool:
    return name in known.get(level, []) or _path(job, level, name).exists()


def _asked(known: Mapping[str, list[str]], job: _Job, names: list[str]) -> dict[str, list[str]]:
    return {level: [name for name in known.get(level, []) if name in names] for level in job.levels}


def _path(job: _Job, level: str, name: str) -> Path:
    return job.folder / level / job.ideal.split / f"{name}.npz"


def _make_name(job: _Job, mesh: AnimatedMesh, name: str, known: dict[str, list[str]]) -> int:
    """One clip at every level that lacks it; what cannot be had goes into `known`."""
    new, attempt = 0, None
    if _path(job, BASE, name).exists():
        attempt = int(load_clip(_path(job, BASE, name)).facts["attempt"])
    for number in range(job.ideal.attempts) if attempt is None else ():
        if _keep(job, mesh, BASE, name, number):
            new, attempt = 1, number
            break
    for level in job.levels:
        if _settled(job, known, level, name):
            continue
        if attempt is not None and _keep(job, mesh, level, name, attempt):
            new += 1
        else:
            known.setdefault(level, []).append(name)
    return new


def _keep(job: _Job, mesh: AnimatedMesh, level: str, name: str, attempt: int) -> bool:
    """Make one clip and save it; False where it has too few usable frames."""
    clip = clip_of(job.identity, mesh, name, attempt, job.levels[level], least_margin=job.margin)
    if clip is None:
        return False
    images = {"crops": clip.crops, "crop_valid": clip.crop_valid, "facts": clip.facts}
    save_clip(_path(job, level, name), clip.columns, clip.label, clip.identity, **images)
    return True
