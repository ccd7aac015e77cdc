"""Who is measured by eval_reconstructor, and how: members by name, trained weights, and the per-object fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError
from aerojax.core.tensors import parameter_count
from aerojax.core.types import Gaussians, View
from aerojax.data.views import ViewSet
from aerojax.evaluate.perceptual import Perceptual
from aerojax.evaluate.reconstruction import scene_figures, targets_at, true_surface, views_at
from aerojax.pipeline.cost import milliseconds
from aerojax.pipeline.step import reconstruct_views
from aerojax.reconstruct.alignment import reconstruct_aligned
from aerojax.reconstruct.base import Reconstructor, TrainableReconstructor
from aerojax.reconstruct.fit.optimise import GaussianFitConfig, fit_gaussians
from aerojax.reconstruct.members import MEMBERS
from aerojax.reconstruct.weights import weights_header

FIT = "fit"
"""The row of the per-object fit."""
Reconstruct = Callable[[View, np.ndarray], tuple[Gaussians, int]]


@dataclass(frozen=True)
class Entrant:
    """One row: how it reconstructs, what its parameters are, and milliseconds of a call where one is worth timing."""

    name: str
    reconstruct: Reconstruct
    parameters: int
    member: Reconstructor | None


def entrants(
    members: Sequence[str], weights: Sequence[Path], fit: GaussianFitConfig, *, seed: int
) -> tuple[Entrant, ...]:
    """Rows in the order of their names, then trained ones; the second of one name is name-2.

    Args:
        members: names of members that need no weights or have shipped ones, and `fit`.
        weights: files of `train_reconstructor`.
        fit: of the row `fit`, which starts at the hull.
        seed: of the fit.

    Raises:
        UserError: a member is unknown, or weights cannot be read.
    """
    found = []
    for name in members:
        if name == FIT:
            found.append(Entrant(FIT, _fitting(fit, seed), 0, None))
        elif name not in MEMBERS:
            known = ", ".join((*MEMBERS, FIT))
            raise UserError("out-of-range", f"entrants: unknown name {name!r}", f"choose of {known}")
        else:
            found.append(_entrant(name, MEMBERS[name]().build()))
    for path in weights:
        config, _ = weights_header(path)
        kind = MEMBERS.get(str(config["name"]))
        if kind is None:
            raise UserError("invalid", f"{path} holds an unknown member {config['name']!r}", "update aerojax")
        member = to_dataclass({**config, "weights": str(path)}, kind, source=str(path)).build()
        found.append(_entrant(_free_name(str(config["name"]), found), member))
    return tuple(found)


def _free_name(name: str, taken: Sequence[Entrant]) -> str:
    options = (name, *(f"{name}-{number}" for number in range(2, len(taken) + 3)))
    return next(option for option in options if option not in {one.name for one in taken})


def _entrant(name: str, member: Reconstructor) -> Entrant:
    def once(views: View, valid: np.ndarray) -> tuple[Gaussians, int]:
        gaussians, count = reconstruct_views(member, views, jnp.asarray(valid))
        return gaussians, int(count)

    def run(views: View, valid: np.ndarray) -> tuple[Gaussians, int]:
        # As the pipeline does, which shifts silhouettes that do not fit.
        made = reconstruct_aligned(partial(once, valid=valid), views, valid)
        return made.gaussians, made.count

    trained = isinstance(member, TrainableReconstructor)
    return Entrant(name, run, parameter_count(member.network) if trained else 0, member)


def _fitting(config: GaussianFitConfig, seed: int) -> Reconstruct:
    hull = MEMBERS["hull"]().build()

    def run(views: View, valid: np.ndarray) -> tuple[Gaussians, int]:
        start, count = reconstruct_views(hull, views, jnp.asarray(valid))
        if int(count) == 0:
            return start, 0
        # In steps of 512, so that scenes share compiled programs.
        index = np.arange(-(-int(count) // 512) * 512) % int(count)
        seen = jax.tree.map(lambda leaf: leaf[np.flatnonzero(valid)], views)
        begin = jax.tree.map(lambda leaf: leaf[index], start)
        fitted = fit_gaussians(begin, seen, config=config, key=jax.random.key(seed))
        return fitted, len(fitted.mean)

    return run


def measured(
    entrant: Entrant, scenes: ViewSet, perceptual: Perceptual | None, progress: Callable[[], None]
) -> tuple[list[dict[str, Any]], list[np.ndarray]]:
    """Figures of every scene with its name, kind, rig, width and distance; and renderings of its targets."""
    rows, pictures = [], []
    for index in range(len(scenes)):
        views, valid = views_at(scenes, index)
        gaussians, count = entrant.reconstruct(views, valid)
        figures, seen = scene_figures(
            gaussians, count, targets_at(scenes, index), true_surface(scenes, index), perceptual
        )
        away = np.linalg.norm(scenes.world_from_cam[index][valid][:, :3, 3], axis=-1)
        about = {"name": scenes.name[index], "kind": scenes.kind[index], "rig": scenes.rig[index]}
        size = {"width_px": float(scenes.width_px[index]), "distance_m": float(np.median(away))}
        rows.append({**about, **size, "cameras": int(valid.sum()), **figures})
        pictures.append(seen)
        progress()
    return rows, pictures


def cost_row(entrant: Entrant, scenes: ViewSet, *, cameras: int, repeats: int) -> dict[str, Any]:
    """Parameters, and the median time of a call with so many cameras, compiled; None for what is no single call."""
    row: dict[str, Any] = {"member": entrant.name, "parameters": entrant.parameters, "cameras": cameras}
    if entrant.member is None:
        return {**row, "ms": None}
    views, _ = views_at(scenes, 0)
    seen = jax.tree.map(lambda leaf: leaf[:cameras], views)
    arguments = entrant.member, seen, jnp.ones(cameras, bool)
    spent = milliseconds(lambda: reconstruct_views(*arguments), repeats=repeats)
    return {**row, "ms": float(np.median(spent))}


def with_masks(scenes: ViewSet, change: str) -> ViewSet:
    """The same scenes with other masks: `none` covers everything, `grown` and `shrunk` are two pixels off, `empty` has
    no mask in the first view.

    Raises:
        UserError: an unknown change.
    """
    if change not in MASKS:
        raise UserError("out-of-range", f"masks: unknown name {change!r}", f"choose of {', '.join(MASKS)}")
    return replace(scenes, mask=MASKS[change](scenes.mask))


def _moved(masks: np.ndarray, combine: Callable[..., np.ndarray]) -> np.ndarray:
    shifted = [np.roll(masks, (dy, dx), (-2, -1)) for dy in (-2, 0, 2) for dx in (-2, 0, 2)]
    return combine.reduce(shifted)  # type: ignore[attr-defined]


def _emptied(masks: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros_like(masks[:, :1]), masks[:, 1:]], axis=1)


MASKS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "none": lambda masks: np.full_like(masks, 255),
    "grown": lambda masks: _moved(masks, np.maximum),
    "shrunk": lambda masks: _moved(masks, np.minimum),
    "empty": _emptied,
}
