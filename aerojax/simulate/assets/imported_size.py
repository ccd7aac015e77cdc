"""How large an imported model is by its class's rule, and where its middle lies."""

from __future__ import annotations

import re

import numpy as np
from jaxtyping import Bool, Float

from aerojax.errors import UserError
from aerojax.simulate.usd_scene import AnimatedMesh

SAMPLES = 31
"""Poses over a cycle. A prime, so that the poses of a rotor with any other number of turns a cycle go round its hub."""
MOVES = 1e-3
"""A part moves if one of its vertices does so by this share of the model's extent."""
_ROTOR = re.compile(r"rotor|propeller|\bprop|_prop|blade|motor", re.IGNORECASE)


def measure(mesh: AnimatedMesh, label: str, source: str) -> float:
    """The length that becomes one metre, in the units of the mesh.

    Birds: the widest that the wings reach in the cycle. Airplanes: the width of what stands still. Helicopters: the
    length of what stands still and is not named a rotor. Drones: the largest horizontal distance between hubs, that is
    between the mean positions of moving parts over the cycle or, where nothing moves, of parts named rotor or motor.

    Args:
        mesh: nose +X, up +Z.
        label: the class.
        source: the model, for the message.

    Raises:
        UserError: if the length is not to be found or zero; the remedy is a number of metres per unit.
    """
    poses, parts = _poses(mesh), _vertices(mesh)
    moving = _moving(poses, parts)
    named = np.array([_ROTOR.search(name.split("/", 3)[-1]) is not None for name in mesh.part_names])
    if label == "bird":
        size = float(np.ptp(poses[:, :, 1], axis=1).max())
    elif label == "drone":
        size = _largest_distance(_hubs(poses, parts, moving if moving.any() else named))
    else:
        still = _chosen(parts, ~(moving | named) if (~(moving | named)).any() else ~moving)
        size = float(np.ptp(poses[0][still, 1 if label == "airplane" else 0]))
    if not size > 0:
        found = "the distance between its motors" if label == "drone" else "its size"
        raise UserError(f"{source}: scale: auto does not find {found}; give scale as metres per unit")
    return size


def middle(mesh: AnimatedMesh) -> Float[np.ndarray, "3"]:
    """Middle of the bounding box of what stands still; of everything, over the cycle's mean, if all moves."""
    poses, parts = _poses(mesh), _vertices(mesh)
    moving = _moving(poses, parts)
    if moving.all():
        return ((poses.min(axis=1) + poses.max(axis=1)) / 2).mean(axis=0)
    still = poses[0][_chosen(parts, ~moving)]
    return (still.min(axis=0) + still.max(axis=0)) / 2


def _poses(mesh: AnimatedMesh) -> Float[np.ndarray, "pose vertex 3"]:
    """Vertices over one cycle."""
    count = SAMPLES if mesh.cycle_seconds > 0 else 1
    return np.stack([mesh.vertices_at(mesh.cycle_seconds * k / count).astype(np.float64) for k in range(count)])


def _vertices(mesh: AnimatedMesh) -> list[np.ndarray]:
    """Vertex indices of each part."""
    return [np.unique(mesh.faces[mesh.part == number]) for number in range(len(mesh.part_names))]


def _moving(poses: Float[np.ndarray, "pose vertex 3"], parts: list[np.ndarray]) -> Bool[np.ndarray, "part"]:
    extent = float(np.ptp(poses[0], axis=0).max())
    travel = np.linalg.norm(poses - poses[:1], axis=2).max(axis=0)
    return np.array([bool((travel[part] > MOVES * extent).any()) for part in parts])


def _chosen(parts: list[np.ndarray], which: Bool[np.ndarray, "part"]) -> np.ndarray:
    return np.concatenate([part for part, kept in zip(parts, which, strict=True) if kept])


def _hubs(
    poses: Float[np.ndarray, "pose vertex 3"], parts: list[np.ndarray], which: Bool[np.ndarray, "part"]
) -> Float[np.ndarray, "part 3"]:
    """Mean positions over the cycle: on the axis of whatever turns whole turns."""
    kept = [part for part, wanted in zip(parts, which, strict=True) if wanted]
    return np.array([poses[:, part].mean(axis=(0, 1)) for part in kept]).reshape(-1, 3)


def _largest_distance(hubs: Float[np.ndarray, "part 3"]) -> float:
    """Between any two, seen from above."""
    apart = np.linalg.norm(hubs[:, None, :2] - hubs[None, :, :2], axis=-1)
    return float(apart.max(initial=0.0))
