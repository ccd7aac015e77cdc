"""Figures of a data set's description: the thesis' Figures 6.1 to 6.4 and 6.7."""

from __future__ import annotations

import numpy as np

from aerojax.core.types import CLASSES
from aerojax.evaluate.dataset_qa.coverage import AREA_NAMES, SWEEP
from aerojax.evaluate.dataset_qa.description import Coverage, Description
from aerojax.evaluate.dataset_qa.motion import ClassMotion
from aerojax.view.dataset.page import Figure, Section
from aerojax.view.dataset.plots import Curve, Labels, bar_plot, curve_plot, heat_png


def sections_of(description: Description) -> tuple[Section, ...]:
    """All figures."""
    rows = description.coverage
    heat = tuple(figure for row in rows for figure in _heat(row))
    curves = {row.rig: Curve(np.arange(1.0, len(row.visibility) + 1), row.visibility) for row in rows}
    labels = Labels("visibility", "at least so many cameras", "share of moments")
    seen = Figure("visibility", "objects seen by at least k cameras", curve_plot(labels, curves))
    return (
        Section("Where objects are in the images", "Centroids of silhouettes, log(1 + number).", heat),
        Section("Size in the image", "Pixels of the mask; SODA's bins below 2000.", tuple(_areas(row) for row in rows)),
        Section("Distance", "Bins around the radii of Sim-1's sweep.", tuple(_distances(row) for row in rows)),
        Section("Cameras that see an object", "", (seen,)),
        Section(
            "How shapes move",
            "Chamfer distance to frame 1, mean and one standard deviation over identities, and magnitude of its "
            "Fourier transform; dashed: median period.",
            tuple(figure for row in description.class_motions for figure in _motion(row)),
        ),
    )


def _heat(row: Coverage) -> tuple[Figure, ...]:
    return tuple(
        Figure(f"heat_{row.rig}_{i + 1:02d}", f"{row.rig}, camera {i + 1}", heat_png(heat))
        for i, heat in enumerate(row.heat)
    )


def _shares(counts: np.ndarray) -> dict[str, list[float]]:
    return {label: (c / max(int(c.sum()), 1)).tolist() for label, c in zip(CLASSES, counts, strict=True)}


def _areas(row: Coverage) -> Figure:
    labels = Labels(f"area, {row.rig}", "pixels of the mask", "share of the class")
    return Figure(f"area_{row.rig}", row.rig, bar_plot(labels, AREA_NAMES, _shares(row.areas)))


def _distances(row: Coverage) -> Figure:
    labels = Labels(f"distance, {row.rig}", "distance to the camera, m", "share of the class")
    names = [f"{radius:g}" for radius in SWEEP]
    return Figure(f"distance_{row.rig}", row.rig, bar_plot(labels, names, _shares(row.distances)))


def _motion(row: ClassMotion) -> tuple[Figure, Figure]:
    frames = len(row.mean)
    time = Labels(f"distance to frame 1, {row.label}", "frame", "Chamfer distance, mm")
    curve = Curve(np.arange(1.0, frames + 1), 1000 * row.mean, 1000 * row.deviation)
    marks = [1 + k * row.period for k in range(1, int((frames - 1) / row.period) + 1)] if row.period else []
    bins = np.arange(len(row.spectrum)) / frames
    frequency = Labels(f"spectrum, {row.label}", "cycles a frame", "magnitude, mm")
    colour = CLASSES.index(row.label)
    return (
        Figure(f"motion_{row.label}", row.label, curve_plot(time, {row.label: curve}, marks=marks, colour=colour)),
        Figure(
            f"spectrum_{row.label}",
            f"{row.label}, spectrum",
            curve_plot(frequency, {row.label: Curve(bins, 1000 * row.spectrum)}, colour=colour),
        ),
    )
