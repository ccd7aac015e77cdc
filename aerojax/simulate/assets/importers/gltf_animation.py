"""Animations of a glTF document as tracks of one clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.gltf_document import Document, read_accessor
from aerojax.simulate.assets.importers.motion import STEP_SECONDS
from aerojax.simulate.assets.importers.scene import Node, Track

_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3, "weights": 1}
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_MOST_ROUNDS = 1000


def clips(document: Document, animation: int | str | None) -> list[dict[str, Any]]:
    """The animations that play: one by its number or name, or, for "first", the first with those that move other nodes.

    Raises:
        UserError: the file lacks the clip; the message lists those that it has.
    """
    listed = document.items("animations")
    names = [str(clip.get("name", i)) for i, clip in enumerate(listed)]
    if animation is None or (animation == "first" and not names):
        return []
    if animation == "first" and "first" not in names:
        return _apart(listed)
    wanted = names.index(animation) if isinstance(animation, str) and animation in names else animation
    if isinstance(wanted, str) or not 0 <= wanted < len(names):
        known = ", ".join(f"{i} ({name})" for i, name in enumerate(names)) or "no clip at all"
        raise UserError(
            "invalid",
            f"{document.path}: animation is {animation!r}, but the file has {known}",
            "use one of them or none",
        )
    return [listed[wanted]]


def _apart(listed: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The first clip and each later one that moves none of the nodes that are moved already."""
    taken, moved = [], set()
    for clip in listed:
        nodes = {str(channel.get("target", {}).get("node")) for channel in clip.get("channels", [])}
        if not nodes & moved:
            taken.append(clip)
            moved |= nodes
    return taken


def tracks_of(
    document: Document, playing: Sequence[dict[str, Any]], place: dict[int, int], nodes: Sequence[Node]
) -> tuple[list[Track], float]:
    """Channels on nodes of the scene and how long they take; each clip starts at 0, and shorter ones go round again."""
    found = [_clip_tracks(document, clip, place, nodes) for clip in playing]
    lengths = [max((float(t.seconds[-1]) for t in tracks), default=0.0) for tracks in found]
    seconds = max(lengths, default=0.0)
    rounds = [_repeated(t, n, seconds) for tracks, n in zip(found, lengths, strict=True) for t in tracks]
    return rounds, seconds


def _repeated(track: Track, length: float, seconds: float) -> Track:
    """A track of a clip that goes round as often as it begins within so many seconds."""
    rounds = min(int(np.ceil(seconds / length - 1e-6)), _MOST_ROUNDS) if length > 0 else 1
    if rounds < 2:
        return track
    starts = np.arange(rounds) * length
    times = starts[:, None] + track.seconds
    times[:-1] = np.minimum(times[:-1], starts[1:, None] - STEP_SECONDS)  # a clip that does not close jumps back
    return replace(track, seconds=times.reshape(-1), values=np.tile(track.values, (rounds, 1)))


def _clip_tracks(document: Document, clip: dict[str, Any], place: dict[int, int], nodes: Sequence[Node]) -> list[Track]:
    """The clip's channels on nodes of the scene, shifted to start at 0."""
    found = []
    for number, channel in enumerate(clip.get("channels", [])):
        target, where = channel.get("target", {}), f"animations[…].channels[{number}]"
        pointer = target.get("extensions", {}).get("KHR_animation_pointer", {}).get("pointer", "")
        if str(pointer).startswith(("/nodes", "/meshes", "/skins")):
            raise document.error(f"{where} moves {pointer} by KHR_animation_pointer, which is not read", "use channels")
        if target.get("node") in place and target.get("path") in _WIDTHS:
            found.append(_track(document, clip, channel, place[target["node"]], nodes, where))
    start = min((float(t.seconds[0]) for t in found), default=0.0)
    return [replace(t, seconds=t.seconds - start) for t in found]


def _track(
    document: Document, clip: dict[str, Any], channel: dict[str, Any], node: int, nodes: Sequence[Node], where: str
) -> Track:
    quantity, sampler = channel["target"]["path"], clip["samplers"][channel["sampler"]]
    interpolation = sampler.get("interpolation", "LINEAR")
    if interpolation not in ("LINEAR", "STEP", "CUBICSPLINE"):
        raise document.error(f"{where} has the interpolation {interpolation!r}")
    seconds = read_accessor(document, sampler.get("input"), f"{where}.input", ("SCALAR",))[:, 0].astype(np.float64)
    if not len(seconds) or (np.diff(seconds) < 0).any():
        raise document.error(f"{where}: times are none, or not in order")
    kind, per_key = _TYPES[_WIDTHS[quantity]], 3 if interpolation == "CUBICSPLINE" else 1
    values = read_accessor(document, sampler.get("output"), f"{where}.output", (kind,)).astype(np.float64)
    if quantity == "weights":  # a scalar accessor, one after the other
        targets = max((len(s.morphs) for s in nodes[node].surfaces), default=0)
        if values.size != len(seconds) * per_key * targets:
            raise document.error(f"{where}: {values.size} weights do not fit {len(seconds)} times of {targets} targets")
        values = values.reshape(len(seconds) * per_key, targets)
    if len(values) != len(seconds) * per_key:
        raise document.error(f"{where}: {len(values)} values do not fit {len(seconds)} times")
    if quantity == "rotation":
        values = values[:, [3, 0, 1, 2]]
        lengths = np.linalg.norm(values[1::3] if per_key == 3 else values, axis=1)
        if not (lengths > 0).all():
            raise document.error(f"{where}: a rotation is zero")
        values = values if per_key == 3 else values / lengths[:, None]
    return Track(node, quantity, seconds, values, interpolation)
