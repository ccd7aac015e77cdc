"""Clips of Gaussians from the sequences of data sets: the work list and what each worker process does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

import jax
import numpy as np

from aerojax.capture.format import read_capture
from aerojax.classify.card import Settings
from aerojax.core.claims import claim, claimed
from aerojax.core.config import to_dataclass, to_mapping
from aerojax.core.errors import UserError
from aerojax.core.seeds import number_of
from aerojax.core.workers import run_jobs
from aerojax.data.clips import RECORD, Fact, clip_files, crop_bytes, one_camera_path, save_clip
from aerojax.data.manifest import read_datasets
from aerojax.pipeline.config import PipelineConfig, clip_settings
from aerojax.pipeline.offline import Clip, reconstruct_capture


@dataclass(frozen=True)
class ClipsConfig:
    """What decides the clips of a data set.

    seed: of the decimation. tokens: kept of each frame's Gaussians.
    """

    seed: int
    tokens: int
    pipeline: PipelineConfig


@dataclass(frozen=True)
class MadeClips:
    """What a run left.

    counts: clips by `rig/split`, those of one camera alone by `rig/split/one_camera`.
    unusable: sequences of which no frame was usable.
    """

    counts: dict[str, int]
    unusable: tuple[str, ...]


@dataclass(frozen=True)
class _Job:
    capture: Path
    rig: str
    label: str
    identity: str
    config: ClipsConfig
    path: Path


def make_clips(
    config: ClipsConfig,
    datasets: tuple[Path, ...],
    folder: Path,
    *,
    only: tuple[str, ...],
    workers: int,
    progress: Callable[[int, int, str], None],
) -> MadeClips:
    """Reconstruct every sequence that has no clip yet: `<folder>/<rig>/<split>/<sequence>.npz`.

    Where no frame shows the object to enough cameras for a place, and single cameras show the whole of it, the clip has
    crops and no Gaussians, and lies in `<folder>/<rig>/<split>/one_camera`.

    A clip exists whole or not at all, and depends on its sequence and the seed alone, so a killed run goes on where it
    stopped and the number of workers changes nothing.

    Args:
        config: decides every byte of a clip.
        datasets: folders of complete data sets.
        folder: of the clips.
        only: patterns of sequence names, such as `sim1_*_r016_*`.
        workers: processes.
        progress: called after each sequence with (done, total, what).

    Raises:
        UserError: a data set is not complete, no sequence is asked for, or the folder holds clips of another
            configuration.
    """
    everything = [
        _Job(s.folder, s.rig, s.label, s.identity, config, folder / s.rig / s.split / f"{s.name}.npz")
        for s in read_datasets(datasets).sequences
    ]
    jobs = [job for job in everything if any(fnmatch(job.path.stem, pattern) for pattern in only)]
    if not jobs:
        raise UserError(
            "out-of-range",
            f"only={list(only)} matches none of {len(everything)} sequences",
            "their names are in dataset.json",
        )
    claim(folder / RECORD, to_mapping(config))
    missing = [job for job in jobs if not job.path.exists() and not one_camera_path(job.path).exists()]
    unusable = []
    for done, name in enumerate(run_jobs(_make_clip, missing, workers=workers), start=1):
        if name is not None:
            unusable.append(name)
        progress(done, len(missing), f"clips in {folder}")
    folders = {job.path.parent for job in jobs} | {one_camera_path(job.path).parent for job in jobs}
    counts = {str(one.relative_to(folder)): len(clip_files(one)) for one in sorted(folders) if one.is_dir()}
    return MadeClips(counts, tuple(sorted(unusable)))


def _facts(job: _Job, clip: Clip) -> dict[str, Fact]:
    """What evaluation groups clips by; without a place, no distance."""
    if clip.one_camera:
        assert clip.seen.crops is not None  # there is nothing else
        boxes = np.array([one.box for one in clip.one_camera.values()])
        width = float(np.median(np.max(boxes[:, 2:] - boxes[:, :2], axis=1)))
        return {"rig": job.rig, "cameras": clip.seen.crops.valid.shape[1], "width_px": width, "one_camera": True}
    seen = [
        (max(box[2] - box[0], box[3] - box[1]), float(np.linalg.norm(pose[:3, 3])))
        for one in clip.observations
        for box, use, pose in zip(one.boxes, one.whole, np.asarray(one.views.camera.world_from_cam), strict=True)
        if use and box is not None
    ]
    width, distance = np.median(np.array(seen), axis=0)
    views = len(clip.observations[0].valid)
    return {"rig": job.rig, "cameras": views, "width_px": float(width), "distance_m": float(distance)}


def settings_of(folder: Path) -> Settings:
    """The pipeline's settings that the clips of a folder, or of one rig in it, came from; () where they are not known.

    Raises:
        UserError: the record names settings that this version does not know.
    """
    for place in (folder.parent, folder):
        values = claimed(place / RECORD)
        if values is not None and "pipeline" in values:
            config = to_dataclass(values["pipeline"], PipelineConfig, source=str(place / RECORD))
            return tuple(sorted(clip_settings(config).items()))
    return ()


def _make_clip(job: _Job) -> str | None:
    """Reconstruct the first object of a sequence and save its clip; its name instead where no frame was usable."""
    key = jax.random.key(number_of(job.config.seed, job.path.stem) % 2**31)
    try:
        clip = reconstruct_capture(
            read_capture(job.capture), job.config.pipeline, key=key, object_id=1, keep_observations=True
        )
    except UserError as error:
        if error.code not in ("no-usable-frames", "object-absent"):
            raise
        return job.path.stem
    columns = np.asarray(clip.in_world().columns())[:, : job.config.tokens]
    crops = clip.seen.crops
    rgba, valid = (None, None) if crops is None else (crop_bytes(np.asarray(crops.rgba)), np.asarray(crops.valid))
    path = one_camera_path(job.path) if clip.one_camera else job.path
    save_clip(path, columns, job.label, job.identity, crops=rgba, crop_valid=valid, facts=_facts(job, clip))
    return None
