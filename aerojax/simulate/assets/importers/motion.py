"""Tracks of an imported clip at chosen times, and the times at which linear interpolation reproduces them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.importers.scene import ImportedScene, Node, Skin, Surface, Track

STEP_SECONDS = 1e-5
"""How long before a key of a stepped track its old value is repeated: far below a time code of 1/120 s."""
SPLINE_SECONDS = 1.0 / 120.0
"""Spacing of samples along cubic splines, which USD cannot interpolate itself: one a time code."""


def key_times(tracks: Iterable[Track]) -> Float[np.ndarray, "time"]:
    """Times between which every track is linear (rotations: along the shortest arc); splines to their spacing."""
    times = [np.zeros(1)]
    for track in tracks:
        times.append(track.seconds)
        if track.interpolation == "STEP":
            times.append(track.seconds[1:] - STEP_SECONDS)
        elif track.interpolation == "CUBICSPLINE":
            first, last = float(track.seconds[0]), float(track.seconds[-1])
            times.append(np.linspace(first, last, 1 + int(np.ceil((last - first) / SPLINE_SECONDS))))
    return np.unique(np.maximum(np.concatenate(times), 0.0))


def values_at(track: Track, seconds: Float[np.ndarray, "time"]) -> Float[np.ndarray, "time component"]:
    """Interpolate a track; before its first and after its last key it holds (glTF 2.0, §3.11 and appendix C)."""
    inside = seconds.clip(track.seconds[0], track.seconds[-1])
    low = (np.searchsorted(track.seconds, inside, side="right") - 1).clip(0, max(len(track.seconds) - 2, 0))
    high = np.minimum(low + 1, len(track.seconds) - 1)
    span = (track.seconds[high] - track.seconds[low])[:, None]
    share = np.where(span > 0, (inside - track.seconds[low])[:, None] / np.where(span > 0, span, 1.0), 0.0)
    turn = track.quantity == "rotation"
    if track.interpolation == "CUBICSPLINE":
        value = _hermite(track.values.reshape(len(track.seconds), 3, -1), low, high, share, span)
        return value / np.linalg.norm(value, axis=1, keepdims=True) if turn else value
    if track.interpolation == "STEP":
        return track.values[np.where(share[:, 0] >= 1.0, high, low)]
    first, second = track.values[low], track.values[high]
    return _slerp(first, second, share) if turn else (1 - share) * first + share * second


def _hermite(keys: np.ndarray, low: np.ndarray, high: np.ndarray, t: np.ndarray, span: np.ndarray) -> np.ndarray:
    """Cubic Hermite spline; tangents are per second (appendix C.5)."""
    value = (2 * t**3 - 3 * t**2 + 1) * keys[low, 1] + (3 * t**2 - 2 * t**3) * keys[high, 1]
    return value + span * ((t**3 - 2 * t**2 + t) * keys[low, 2] + (t**3 - t**2) * keys[high, 0])


def _slerp(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Along the shorter arc between unit quaternions (appendix C.4)."""
    cosine = np.sum(first * second, axis=1, keepdims=True)
    second, cosine = np.where(cosine < 0, -second, second), np.abs(cosine).clip(0, 1)
    angle = np.arccos(cosine)
    sine = np.where(angle > 1e-6, np.sin(angle), 1.0)
    value = np.where(angle > 1e-6, np.sin((1 - share) * angle) / sine, 1 - share) * first
    value = value + np.where(angle > 1e-6, np.sin(share * angle) / sine, share) * second
    return value / np.linalg.norm(value, axis=1, keepdims=True)


def at_speed(scene: ImportedScene, speed: float) -> ImportedScene:
    """The same clip, played `speed` times as fast."""
    tracks = tuple(_quicker(track, speed) for track in scene.tracks)
    return replace(scene, tracks=tracks, seconds=scene.seconds / speed)


def _quicker(track: Track, speed: float) -> Track:
    values = track.values
    if track.interpolation == "CUBICSPLINE":  # tangents are per second
        values = values.reshape(len(track.seconds), 3, -1) * np.array([speed, 1.0, speed])[:, None]
        values = values.reshape(track.values.shape)
    return replace(track, seconds=track.seconds / speed, values=values)


def without_mirrors(scene: ImportedScene) -> ImportedScene:
    """The same scene with no mirroring transform, so that no reader has to turn faces by itself.

    With s = -1 for every node that is mirrored in the world and 1 otherwise, W' = W·s: locally translation' = s_parent
    · translation and scale' = s_parent · s · scale, points' = s · points, and faces of mirrored surfaces are turned,
    as glTF means them (§3.7.4: a negative determinant reverses the winding order).
    """
    signs: list[float] = []
    for node in scene.nodes:
        signs.append(_parent_sign(node, signs) * float(np.sign(np.prod(node.scale)) or 1.0))
    if all(sign > 0 for sign in signs):
        return scene
    parents = [_parent_sign(node, signs) for node in scene.nodes]
    return replace(
        scene,
        nodes=tuple(_unmirrored(n, p, s) for n, p, s in zip(scene.nodes, parents, signs, strict=True)),
        skins=tuple(_unmirrored_skin(skin, signs) for skin in scene.skins),
        tracks=tuple(_unmirrored_track(t, parents[t.node], signs[t.node]) for t in scene.tracks),
    )


def _parent_sign(node: Node, signs: list[float]) -> float:
    return signs[node.parent] if node.parent >= 0 else 1.0


def _unmirrored(node: Node, parent: float, sign: float) -> Node:
    x, y, z = (parent * v for v in node.translation)
    a, b, c = (parent * sign * v for v in node.scale)
    turned = sign < 0 and node.skin is None  # the node of a skinned mesh does not move it
    surfaces = tuple(_turned(s) for s in node.surfaces) if turned else node.surfaces
    return replace(node, translation=(x, y, z), scale=(a, b, c), surfaces=surfaces)


def _turned(surface: Surface) -> Surface:
    return replace(
        surface,
        points=-surface.points,
        faces=surface.faces[:, ::-1],
        normals=None if surface.normals is None else -surface.normals,
        morphs=tuple(-offsets for offsets in surface.morphs),
    )


def _unmirrored_skin(skin: Skin, signs: list[float]) -> Skin:
    mirror = np.array([[signs[j], signs[j], signs[j], 1.0] for j in skin.joints])
    return replace(skin, joint_from_mesh=mirror[:, :, None] * skin.joint_from_mesh)


def _unmirrored_track(track: Track, parent: float, sign: float) -> Track:
    factor = {"translation": parent, "scale": parent * sign}.get(track.quantity, 1.0)
    return replace(track, values=track.values * factor)
