"""The five rotation protocols: which rotations training and test see, drawn once a clip and shared by all models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from aerojax.classify.base import TrainRotation
from aerojax.core.errors import UserError
from aerojax.core.files import whole_file
from aerojax.core.seeds import seed_of
from aerojax.core.types import Gaussians
from aerojax.gaussians.rotate import rotate
from aerojax.geometry.rotations import rotation_from_quaternion

TestRotation = Literal["none", "z", "so3", "so3_per_frame"]
TEST_ROTATIONS: tuple[TestRotation, ...] = get_args(TestRotation)


@dataclass(frozen=True)
class Protocol:
    """A row of thesis Table 5.6: rotations of the training clips, and of the test clips or their frames."""

    name: str
    train: TrainRotation
    test: TestRotation


PROTOCOLS = (
    Protocol("none/none", "none", "none"),
    Protocol("z/z", "z", "z"),
    Protocol("z/SO3", "z", "so3"),
    Protocol("SO3/SO3", "so3", "so3"),
    Protocol("z/SO3_pf", "z", "so3_per_frame"),
)


def protocols_of(trained: TrainRotation, *, exactly_invariant: bool) -> tuple[Protocol, ...]:
    """The protocols that a model can answer for.

    The loss of an exactly invariant model is the same however its training clips are turned, so it answers for all.
    """
    return tuple(p for p in PROTOCOLS if exactly_invariant or p.train == trained)


def quaternions_from_normals(normals: Float[np.ndarray, "*batch 4"]) -> Float[np.ndarray, "*batch 4"]:
    """Haar rotations as unit quaternions (w, x, y, z), w ≥ 0, from four normal numbers each (Muller 1959)."""
    unit = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.where(unit[..., :1] < 0, -unit, unit)


def quaternions_about_z(angle: Float[np.ndarray, "*batch"]) -> Float[np.ndarray, "*batch 4"]:
    """Rotations by `angle` radians about +Z as unit quaternions, w ≥ 0."""
    zero = np.zeros_like(angle)
    turn = np.stack([np.cos(angle / 2), zero, zero, np.sin(angle / 2)], axis=-1)
    return np.where(turn[..., :1] < 0, -turn, turn)


def draw_rotations(
    clip: str, kind: TestRotation, *, frames: int, seed: int, trial: int
) -> Float[np.ndarray, "{frames} 4"]:
    """The rotation of each frame of a clip as a unit quaternion, equal for all frames unless drawn per frame.

    A function of its arguments alone: the order of clips, other clips and the length of the clip change nothing, and
    two pairs of seed and trial never share a rotation.
    """
    rng = np.random.default_rng(seed_of(kind, seed, trial, clip))
    if kind == "so3_per_frame":
        return quaternions_from_normals(rng.normal(size=(frames, 4)))
    if kind == "so3":
        one = quaternions_from_normals(rng.normal(size=4))
    else:
        one = quaternions_about_z(np.asarray(rng.uniform(0, 2 * np.pi) if kind == "z" else 0.0))
    return np.tile(one, (frames, 1))


def cached_rotations(
    folder: Path, clips: Sequence[str], kind: TestRotation, *, frames: int, seed: int, trial: int
) -> Float[np.ndarray, "clip {frames} 4"]:
    """Rotations of clips by their names, from the folder's file for this draw; what it lacks is drawn and added.

    Raises:
        UserError: a file that is there cannot be read.
    """
    path = folder / f"{kind}_seed{seed}_trial{trial}_frames{frames}.npz"
    known = _read(path)
    missing = [clip for clip in clips if clip not in known]
    if missing:
        known |= {clip: draw_rotations(clip, kind, frames=frames, seed=seed, trial=trial) for clip in missing}
        names = sorted(known)
        with whole_file(path) as temporary:
            np.savez(temporary, clip=np.array(names), quaternion=np.stack([known[name] for name in names]))
    return np.stack([known[clip] for clip in clips])


def _read(path: Path) -> dict[str, np.ndarray]:
    if not path.exists():
        return {}
    try:
        with np.load(path, allow_pickle=False) as stored:
            return dict(zip(stored["clip"].tolist(), stored["quaternion"], strict=True))
    except (OSError, EOFError, ValueError, KeyError) as error:
        raise UserError(
            "unreadable", f"{path} cannot be read as rotations ({error})", "delete it, it is drawn again alike"
        ) from None


def rotate_clip(
    columns: Float[Array, "time token 14"], quaternion: Float[Array, "time 4"]
) -> Float[Array, "time token 14"]:
    """Turn every frame about the world's origin: centres and axes turn, sizes, opacity and the DC colour stay."""

    def turn(frame: Float[Array, "token 14"], q: Float[Array, "4"]) -> Float[Array, "token 14"]:
        return rotate(Gaussians.from_columns(frame), rotation_from_quaternion(q)).columns()

    return jax.vmap(turn)(columns, jnp.asarray(quaternion, columns.dtype))
