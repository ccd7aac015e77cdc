"""From an individual to its clips: body, flights, windows, crops, hulls, decimated Gaussians."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Int, Key

from aerojax.core.seeds import number_of
from aerojax.core.types import CLASSES, UNKNOWN, Camera, Gaussians, View
from aerojax.data.clips import Fact, StoredClip, crop_bytes
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.gaussians.rotate import transform
from aerojax.pipeline.factory.config import FactoryConfig
from aerojax.pipeline.factory.observations import ClipCrops, crop_clip, see_clip
from aerojax.pipeline.factory.plan import ClipPlan, clip_name, plan_clip
from aerojax.pipeline.step import decimate_in_rig, reconstruct_views
from aerojax.reconstruct.alignment import reconstruct_aligned
from aerojax.reconstruct.base import ReconstructorConfig
from aerojax.reconstruct.crop import small_crops
from aerojax.reconstruct.hull import HullConfig
from aerojax.reconstruct.hull_warp import hull_of_crops
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import Identity
from aerojax.simulate.usd.animated_mesh import AnimatedMesh


def clips_of(
    identity: Identity, indices: Sequence[int], config: FactoryConfig
) -> Iterator[tuple[str, StoredClip | None]]:
    """Make some of an individual's clips, by name; None where no attempt had enough usable frames."""
    mesh = build_animated(identity)
    for index in indices:
        name = clip_name(identity, index)
        tries = (clip_of(identity, mesh, name, attempt, config) for attempt in range(config.attempts))
        yield name, next((clip for clip in tries if clip is not None), None)


def clip_of(
    identity: Identity, mesh: AnimatedMesh, name: str, attempt: int, config: FactoryConfig, *, least_margin: int = 0
) -> StoredClip | None:
    """One attempt at a clip; None where it has fewer than `config.least_frames` usable frames.

    Arguments as for `plan_clip`.
    """
    plan = plan_clip(identity, mesh, name, attempt, config, least_margin=least_margin)
    crops = crop_clip(see_clip(plan, mesh, config), plan, config)
    if crops is None or len(crops.valid) < config.least_frames:
        return None
    columns, kept = gaussians_of(crops, name, config)
    if len(kept) < config.least_frames:
        return None
    views = len(plan.cameras)
    size = config.pipeline.view_size
    small = [small_crops(crops.rgb[f, :views], crops.mask[f, :views], size=size) for f in kept]
    return StoredClip(
        columns,
        identity.label,
        identity.name,
        crop_bytes(np.stack(small)),
        (crops.valid & ~crops.cut)[kept, :views],
        facts_of(plan, crops) | ({"kind": identity.family} if identity.label == UNKNOWN else {}),
        (UNKNOWN,) if identity.label == UNKNOWN else CLASSES,
    )


def facts_of(plan: ClipPlan, crops: ClipCrops) -> dict[str, Fact]:
    """What is known of a clip: rig, cameras, size, distance, rate, motion, faults, and draws that came before."""
    return {
        "rig": plan.kind,
        "cameras": len(plan.cameras),
        "width_px": crops.width_px,
        "distance_m": crops.distance_m,
        "fps": plan.fps,
        "motion": plan.motion,
        "attempt": plan.attempt,
        **asdict(plan.faults),
    }


def gaussians_of(
    crops: ClipCrops, name: str, config: FactoryConfig
) -> tuple[Float32[np.ndarray, "time token 14"], list[int]]:
    """Decimated Gaussians in the world's frame, and the frames whose silhouettes meet, as indices into the crops'."""
    key = jax.random.key(number_of(config.seed, name) % 2**31)
    world_from_rig = _single(crops.world_from_rig)
    size, kept, columns = config.pipeline.crop_size, [], []
    for frame, valid in enumerate(crops.valid):
        camera = Camera(_single(crops.K[frame]), _single(crops.crop_from_cam[frame]), size, size)
        whole = valid & ~crops.cut[frame]
        # Frames without a cut view are made as if there were none in the clip.
        known = None if crops.known is None or not crops.cut[frame].any() else jnp.asarray(crops.known[frame])
        views = View(_single(crops.rgb[frame]), _single(crops.mask[frame]), camera, known)
        reconstruct = partial(_reconstruct, valid=valid, config=config.pipeline.reconstruct)
        made = reconstruct_aligned(reconstruct, views, valid, whole=whole)
        if made.count == 0:
            continue
        shift = _single(crops.rig_from_crop[frame])
        chosen = jax.random.fold_in(key, int(crops.numbers[frame]))
        thinned = _tokens(made.gaussians, made.count, shift, world_from_rig, chosen, config.pipeline.decimation)
        columns.append(np.asarray(thinned))
        kept.append(frame)
    shape = (0, config.tokens, 14)
    return (np.stack(columns)[:, : config.tokens] if kept else np.zeros(shape, np.float32)), kept


def _single(values: np.ndarray) -> Float32[Array, "..."]:
    return jnp.asarray(values, jnp.float32)


def _reconstruct(views: View, valid: Bool[np.ndarray, "view"], config: ReconstructorConfig) -> tuple[Gaussians, int]:
    """The pipeline's Gaussians of one frame; the hull by its faster twin."""
    if isinstance(config, HullConfig):
        return hull_of_crops(views, valid, config=config)[:2]
    found, count = reconstruct_views(config.build(), views, jnp.asarray(valid))
    return found, int(count)


@partial(jax.jit, static_argnames="config")
def _tokens(
    gaussians: Gaussians,
    count: Int[Array, ""] | int,
    rig_from_crop: Float[Array, "3"],
    world_from_rig: Float[Array, "4 4"],
    key: Key[Array, ""],
    config: DecimationConfig,
) -> Float[Array, "token 14"]:
    """The pipeline's Gaussians in the world's frame."""
    return transform(decimate_in_rig(gaussians, count, rig_from_crop, key, config), world_from_rig).columns()
