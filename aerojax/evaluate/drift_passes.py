"""The forward passes behind `measure_drift`: clips turned or relabelled, logits of all of them in one program."""

from __future__ import annotations

from functools import partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from aerojax.classify.base import Trainable
from aerojax.core.types import Crops
from aerojax.data.windows import Windows
from aerojax.evaluate.answers import crops_from_bytes, crops_read
from aerojax.evaluate.drift import axis_relabellings, drift_figures, relabel_axes
from aerojax.evaluate.rotations import draw_rotations, rotate_clip

Change = Literal["rotation", "relabelling"]


@partial(jax.jit, static_argnames=("change",))
def _logits(
    classifier: Trainable,
    columns: Array,
    mask: Array,
    crops: Any,
    clip: Array,
    changes: tuple[Array, ...],
    change: Change,
) -> Float[Array, "pass label"]:
    """Logits of clip `clip[i]` after change `i`."""

    def one(inputs: tuple[Array, tuple[Array, ...]]) -> Array:
        index, what = inputs
        changed = (rotate_clip if change == "rotation" else relabel_axes)(columns[index], *what)
        views = jax.tree.map(lambda leaf: leaf[index], crops)
        return classifier.logits(classifier.prepare(changed), mask[index], views)

    return jax.lax.map(one, (clip, changes), batch_size=16)


def _ask(classifier: Trainable, windows: Windows, changes: tuple[np.ndarray, ...], change: Change) -> np.ndarray:
    """Logits (pass, clip, label) of changes whose leading axes are (pass, clip)."""
    passes, clips = changes[0].shape[:2]
    kind = jnp.result_type(jax.tree.leaves(classifier)[0])
    columns = jnp.asarray(windows.columns, kind)
    mask = jnp.broadcast_to(jnp.asarray(windows.present)[..., None], columns.shape[:3])
    flat = tuple(jnp.asarray(c.reshape(-1, *c.shape[2:])) for c in changes)
    found = _logits(
        classifier, columns, mask, _crops(classifier, windows), jnp.tile(jnp.arange(clips), passes), flat, change
    )
    return np.asarray(found).reshape(passes, clips, -1)


def _drift(classifier: Trainable, windows: Windows, changes: tuple[np.ndarray, ...], change: Change) -> dict[str, Any]:
    """Figures of changes of which pass 0 is the identity, against the clips as they are."""
    original = _original(classifier, windows)
    changed = _ask(classifier, windows, changes, change)
    return drift_figures(original, changed[0], changed[1:])


@jax.jit
def _plain(classifier: Trainable, columns: Array, mask: Array, crops: Any) -> Float[Array, "clip label"]:
    def one(clip: tuple[Any, ...]) -> Array:
        columns, mask, crops = clip
        return classifier.logits(classifier.prepare(columns), mask, crops)

    return jax.lax.map(one, (columns, mask, crops), batch_size=16)


def _crops(classifier: Trainable, windows: Windows) -> Crops | None:
    found = crops_read(classifier, windows)
    return None if found is None else crops_from_bytes(*found, kind=jax.tree.leaves(classifier)[0].dtype)


def _original(classifier: Trainable, windows: Windows) -> np.ndarray:
    columns = jnp.asarray(windows.columns, jnp.result_type(jax.tree.leaves(classifier)[0]))
    mask = jnp.broadcast_to(jnp.asarray(windows.present)[..., None], columns.shape[:3])
    return np.asarray(_plain(classifier, columns, mask, _crops(classifier, windows)))


def rotation_drift(
    classifier: Trainable, windows: Windows, rotations: int, *, seed: int, double: bool = False
) -> dict[str, Any]:
    """Drift over Haar rotations of every clip, each clip with its own.

    Args:
        classifier: its network's own logits are taken, of all tokens at once.
        windows: the clips.
        rotations: of each clip.
        seed: of the rotations.
        double: in double precision, which tells a leak of the network from rounding.
    """
    frames = windows.present.shape[1]
    turns = [[draw_rotations(name, "none", frames=frames, seed=seed, trial=0) for name in windows.name]]
    for trial in range(rotations):
        turns.append([draw_rotations(name, "so3", frames=frames, seed=seed, trial=trial) for name in windows.name])
    if not double:
        return _drift(classifier, windows, (np.array(turns, np.float32),), "rotation")
    with jax.enable_x64(True):
        precise = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64), classifier)
        return _drift(precise, windows, (np.array(turns),), "rotation")


def relabelling_drift(classifier: Trainable, windows: Windows, *, seed: int) -> dict[str, Any]:
    """Drift over the 24 quaternions of an ellipsoid: 24 times the same one for all Gaussians, 24 times one each."""
    quaternion, order = axis_relabellings()
    shape = (len(windows.label), windows.columns.shape[2])
    chosen = [np.full(shape, k) for k in range(24)]
    chosen += list(np.random.default_rng(seed).integers(24, size=(24, *shape)))
    index = np.array(chosen)
    return _drift(classifier, windows, (quaternion[index].astype(np.float32), order[index]), "relabelling")
