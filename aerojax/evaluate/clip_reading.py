"""Clips of several folders, read by a classifier as the pipeline reads them."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.evaluate.labels import label_figures
from aerojax.pipeline.offline import clip_probabilities
from aerojax.training.variation import ClipSet, join_clips, load_clips


def load_split(folders: tuple[Path, ...], split: str, frames: int) -> ClipSet:
    """The clips of one split of several folders, cut or padded to `frames`."""
    return join_clips([load_clips(folder / split, frames=frames) for folder in folders])


@partial(jax.jit, static_argnames=("tokens", "readings"))
def _probabilities(model: MambaSplat, columns: jax.Array, present: jax.Array, tokens: int, readings: int) -> jax.Array:
    return jax.vmap(partial(clip_probabilities, model, tokens=tokens, readings=readings))(columns, present)


def predict(
    model: MambaSplat, clips: ClipSet, tokens: int, *, readings: int = 1, batch: int = 32
) -> Float[np.ndarray, "clip label"]:
    """Log-probabilities (clip, class) of whole clips, read as the pipeline reads them."""
    parts = []
    for start in range(0, len(clips.label), batch):
        index = np.arange(start, start + batch) % len(clips.label)  # one shape, one compilation
        parts.append(_probabilities(model, clips.columns[index], clips.present[index], tokens, readings))
    return np.log(np.maximum(np.concatenate(parts)[: len(clips.label)], 1e-12))


def test_figures(
    model: MambaSplat, folders: tuple[Path, ...], more: tuple[Path, ...], *, frames: int, tokens: int
) -> dict[str, dict[str, Any]]:
    """Figures of every folder's test split by the folder's name, and of `folders` together as `all`."""
    sets = {folder.name: load_split((folder,), "test", frames) for folder in (*folders, *more)}
    sets["all"] = load_split(folders, "test", frames)
    return {
        name: {
            **label_figures(predict(model, clips, tokens, readings=4), clips.label),
            "identities": len(set(clips.identity)),
        }
        for name, clips in sets.items()
    }
