"""How large an imported model is by its class's rule, and where its middle lies."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from aerojax.core.errors import UserError
from aerojax.simulate.usd.animated_mesh import AnimatedMesh

SAMPLES = 61
"""Poses over a cycle. A prime, so that the poses of a rotor with any other number of turns a cycle go round its hub."""
MOVES = 1e-3
"""A part moves if one of its vertices does so by this share of the model's extent, along any axis."""
_ROTOR = re.compile(r"rotor|propeller|\bprop|_prop|blade|motor", re.IGNORECASE)


@dataclass(frozen=True)
class Survey:
    """A model's poses over one cycle and what its parts do.

    poses: nose +X, up +Z. parts: vertices of each. named: its path names it a rotor, a propeller, a blade or a motor.
    """

    poses: Float[np.ndarray, "pose vertex 3"]
    parts: tuple[Int[np.ndarray, "_"], ...]
    moving: Bool[np.ndarray, "part"]
    named: Bool[np.ndarray, "part"]

    def vertices(self, which: Bool[np.ndarray, "part"]) -> Int[np.ndarray, "_"]:
        """Vertices of the chosen parts."""
        return np.concatenate([part for part, kept in zip(self.parts, which, strict=True) if kept])


def survey(mesh: AnimatedMesh) -> Survey:
    """Sample a cycle and tell what moves from what stands still."""
    count = SAMPLES if mesh.cycle_seconds > 0 else 1
    poses = np.stack([mesh.vertices_at(mesh.cycle_seconds * k / count) for k in range(count)])
    parts = tuple(np.unique(mesh.faces[mesh.part == number]) for number in range(len(mesh.part_names)))
    travel = np.zeros(poses.shape[1], np.float32)
    for pose in poses[1:]:
        np.maximum(travel, np.abs(pose - poses[0]).max(axis=1), out=travel)
    least = MOVES * float(np.ptp(poses[0], axis=0).max())
    moving = np.array([bool((travel[part] > least).any()) for part in parts])
    named = np.array([_ROTOR.search(name.split("/", 3)[-1]) is not None for name in mesh.part_names])
    return Survey(poses, parts, moving, named)


def length_by_class(found: Survey, label: str, source: str) -> float:
    """The length that becomes one metre, in the units of the survey.

    Birds: the widest that the wings reach in the cycle. Airplanes: the width of what stands still. Helicopters: the
    length of what stands still and is not named a rotor. Drones: the largest horizontal distance between hubs, that is
    between the mean positions of moving parts over the cycle or, where nothing moves, of parts named rotor or motor.

    Raises:
        UserError: if the length is not to be found or zero; the remedy is a number of metres per unit.
    """
    poses, moving = found.poses, found.moving
    if label == "bird":
        size = float(np.ptp(poses[:, :, 1], axis=1).max())
    elif label == "drone":
        size = _largest_distance(_hubs(found, moving if moving.any() else found.named))
    else:
        fixed = ~moving if label == "airplane" else ~(moving | found.named)
        still = found.vertices(fixed if fixed.any() else np.ones_like(moving))
        size = float(np.ptp(poses[0][still, 1 if label == "airplane" else 0]))
    if not size > 0:
        what = "the distance between its motors" if label == "drone" else "its size"
        raise UserError("invalid", f"{source}: scale: auto does not find {what}", "give scale as metres per unit")
    return size


def middle(found: Survey) -> Float[np.ndarray, "3"]:
    """Middle of the bounding box of what stands still; of everything, averaged over the cycle, if all moves."""
    if found.moving.all():
        return ((found.poses.min(axis=1) + found.poses.max(axis=1)) / 2).mean(axis=0).astype(np.float64)
    still = found.poses[0][found.vertices(~found.moving)].astype(np.float64)
    return (still.min(axis=0) + still.max(axis=0)) / 2


def _hubs(found: Survey, which: Bool[np.ndarray, "part"]) -> Float[np.ndarray, "hub 3"]:
    """Mean positions over the cycle: on the axis of whatever turns whole turns."""
    kept = [part for part, wanted in zip(found.parts, which, strict=True) if wanted]
    return np.array([found.poses[:, part].mean(axis=(0, 1), dtype=np.float64) for part in kept]).reshape(-1, 3)


def _largest_distance(hubs: Float[np.ndarray, "hub 3"]) -> float:
    """Between any two, seen from above."""
    apart = np.linalg.norm(hubs[:, None, :2] - hubs[None, :, :2], axis=-1)
    return float(apart.max(initial=0.0))
