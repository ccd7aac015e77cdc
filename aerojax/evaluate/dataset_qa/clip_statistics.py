"""What reconstructed Gaussians of clips are like: how many, how large, how opaque, and how their shape moves.

The thesis' Figures 6.6, 6.7, B.3 to B.10 (motion by distance) and B.11 to B.14 (attributes), of our own clips. Lengths
are in units of a clip's root mean square radius about its frames' centres, so that classes of all sizes compare.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float

from aerojax.core.types import CLASSES, SH_C0
from aerojax.data.clips import StoredClip
from aerojax.evaluate.dataset_qa.motion import chamfer_matrix, detect_period, lag_curve, spectrum

QUARTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Of every attribute that is described."""
_ATTRIBUTES = "scale", "anisotropy", "opacity", "angle_deg", "red", "green", "blue"


@dataclass(frozen=True)
class ClipStatisticsConfig:
    """How clips are described.

    every: only every so many-th clip of a folder is read.
    points: Gaussians of a frame whose centres are compared, spread over it; the comparison grows with their number.
    distances, widths: metres from the cameras and pixels that an object spans, the ends of the groups.
    """

    every: int = 1
    points: int = 128
    distances: tuple[float, ...] = (0.0, 8.0, 32.0, 64.0, 100.0, 200.0, 1000.0)
    widths: tuple[float, ...] = (0.0, 16.0, 24.0, 40.0, 80.0, 1000.0)


@dataclass(frozen=True, eq=False)
class ClipStatistics:
    """What one clip is like.

    label: its class. identity: its individual. distance_m, width_px: NaN where unknown.
    gaussians: different ones of its median frame.
    to_first, spectrum: Chamfer distance of each frame to the first one, in radii, and its magnitudes by frequency.
    periodic: whether the shape returns within the clip.
    attributes: quantiles `QUARTILES` of every attribute: geometric mean of the scales in radii, largest over smallest
        scale, opacity, degrees that a Gaussian is turned from the axes (0..180), and sRGB of its DC colour.
    """

    label: str
    identity: str
    distance_m: float
    width_px: float
    gaussians: int
    to_first: Float[np.ndarray, "time"]
    spectrum: Float[np.ndarray, "frequency"]
    periodic: bool
    attributes: dict[str, Float[np.ndarray, "quantile"]]


def clip_statistics(clip: StoredClip, points: int) -> ClipStatistics:
    """Describe one clip of at least two frames."""
    columns = np.asarray(clip.columns, np.float64)
    centred = columns[..., :3] - columns[..., :3].mean(axis=1, keepdims=True)
    radius = float(np.sqrt(np.mean(np.sum(centred**2, axis=-1)))) or 1.0
    matrix = chamfer_matrix(np.stack([spread_points(cloud, points) for cloud in centred / radius]))
    facts = clip.facts
    return ClipStatistics(
        label=clip.label,
        identity=clip.identity,
        distance_m=float(facts.get("distance_m", np.nan)),
        width_px=float(facts.get("width_px", np.nan)),
        gaussians=int(np.median([len(np.unique(frame[:, :3], axis=0)) for frame in columns])),
        to_first=matrix[0],
        spectrum=spectrum(matrix[0]),
        periodic=detect_period(lag_curve(matrix)) is not None,
        attributes=_attributes(columns.reshape(-1, columns.shape[-1]), radius),
    )


def spread_points(cloud: Float[np.ndarray, "point 3"], count: int) -> Float[np.ndarray, "count 3"]:
    """Farthest points of a cloud, the first one first (Gonzalez 1985); all of it if it has fewer."""
    if len(cloud) <= count:
        return cloud
    chosen, far = [0], np.sum((cloud - cloud[0]) ** 2, axis=1)
    for _ in range(count - 1):
        chosen.append(int(np.argmax(far)))
        far = np.minimum(far, np.sum((cloud - cloud[chosen[-1]]) ** 2, axis=1))
    return cloud[chosen]


def _attributes(rows: Float[np.ndarray, "gaussian 14"], radius: float) -> dict[str, Float[np.ndarray, "quantile"]]:
    scale = np.maximum(rows[:, 7:10], 1e-12)
    angle = np.degrees(2 * np.arccos(np.clip(np.abs(rows[:, 3]), 0.0, 1.0)))
    colour = np.clip(rows[:, 11:14] * SH_C0 + 0.5, 0.0, 1.0)
    values = (np.exp(np.log(scale).mean(axis=1)) / radius, scale.max(axis=1) / scale.min(axis=1), rows[:, 10], angle)
    every = dict(zip(_ATTRIBUTES, (*values, *colour.T), strict=True))
    return {name: np.quantile(values, QUARTILES) for name, values in every.items()}


def summary_of(clips: Iterable[ClipStatistics], config: ClipStatisticsConfig) -> dict[str, Any]:
    """Tables by class, and by class and distance or width, JSON-ready.

    Returns:
        `attributes`, a row a class with the medians over clips of each attribute's quantiles; `gaussians`, quantiles of
        their number; `by_distance` and `by_width`, rows with the mean curve of distances to the first frame, its
        deviation, its mean spectrum without the constant, the strongest bin, the amplitude (largest less smallest
        distance of frames after the first) and the share of clips whose shape returns.
    """
    every = list(clips)
    known = [name for name in CLASSES if any(clip.label == name for clip in every)]
    mine = {name: [clip for clip in every if clip.label == name] for name in known}
    return {
        "clips": len(every),
        "identities": len({clip.identity for clip in every}),
        "quantiles": list(QUARTILES),
        "gaussians": [
            {"class": name, "quantiles": np.quantile([clip.gaussians for clip in of], QUARTILES).tolist()}
            for name, of in mine.items()
        ],
        "attributes": [
            {"class": name, "attribute": attribute, "quantiles": _medians(of, attribute)}
            for name, of in mine.items()
            for attribute in _ATTRIBUTES
        ],
        "by_distance": _grouped(mine, "distance_m", config.distances),
        "by_width": _grouped(mine, "width_px", config.widths),
    }


def _medians(clips: Sequence[ClipStatistics], attribute: str) -> list[float]:
    return np.median([clip.attributes[attribute] for clip in clips], axis=0).tolist()


def _grouped(mine: dict[str, list[ClipStatistics]], fact: str, edges: Sequence[float]) -> list[dict[str, Any]]:
    rows = []
    for name, clips in mine.items():
        for low, high in pairwise(edges):
            inside = [clip for clip in clips if low <= getattr(clip, fact) < high and len(clip.to_first) > 2]
            if inside:
                rows.append({"class": name, "from": low, "to": high, **_motion(inside)})
    return rows


def _motion(clips: Sequence[ClipStatistics]) -> dict[str, Any]:
    length = min(len(clip.to_first) for clip in clips)
    curves = np.stack([clip.to_first[:length] for clip in clips])
    magnitudes = np.mean([spectrum(curve)[1:] for curve in curves], axis=0)
    return {
        "clips": len(clips),
        "to_first": curves.mean(axis=0).tolist(),
        "deviation": curves.std(axis=0).tolist(),
        "amplitude": float(np.mean(curves[:, 1:].max(axis=1) - curves[:, 1:].min(axis=1))),
        "spectrum": magnitudes.tolist(),
        "strongest_bin": int(np.argmax(magnitudes)) + 1,
        "periodic": float(np.mean([clip.periodic for clip in clips])),
    }
