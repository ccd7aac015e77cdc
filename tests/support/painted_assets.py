"""A small asset with every kind of part, surfaces and layers to colour, and bilinear filtering."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerojax.simulate.assets.mesh import lofts, shapes
from aerojax.simulate.assets.mesh.parts import Part, Spin
from aerojax.simulate.assets.paint import patterns
from aerojax.simulate.usd.authoring import Asset

PLANE = Asset(
    (
        Part("hull", shapes.ellipsoid((0.0, 0.0, 0.0), (0.5, 0.1, 0.1))),
        Part("canopy", shapes.ellipsoid((0.2, 0.0, 0.1), (0.1, 0.05, 0.05)), 1),
        Part("wings", shapes.box((0.0, 0.0, 0.05), (0.2, 1.0, 0.02)), 0),
        Part(
            "propeller",
            lofts.rotor(lofts.RotorShape(2, 0.2, 0.03, 0.02)),
            3,
            Spin((0.5, 0.0, 0.0), (1.0, 0.0, 0.0), 20.0),
        ),
        Part("disc", shapes.ring((0.5, 0.0, 0.0), 0.2, 0.01, 0.01), 3, opacity=0.25),
    )
)


def bilinear(image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Filter an image at texel coordinates, clamped at its border."""
    x, y = x - 0.5, y - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    total = np.zeros((len(x), image.shape[2]))
    for i in (0, 1):
        for j in (0, 1):
            weight = (1 - abs(x - column - j)) * (1 - abs(y - row - i))
            rows, columns = (row + i).clip(0, image.shape[0] - 1), (column + j).clip(0, image.shape[1] - 1)
            total += weight[:, None] * image[rows, columns]
    return total


def surface_at(position: np.ndarray, normal=(0.0, 0.0, 1.0)) -> patterns.Surface:
    half = np.array([0.5, 0.5])
    normals = np.repeat([normal], len(position), axis=0)
    return patterns.Surface(position, normals, position[:, 0] / half[0], np.abs(position[:, 1]) / half[1])


def layer(kind: str, **changes) -> patterns.Layer:
    return replace(patterns.Layer(kind, 1, 0.5, 0.5, 8.0, 3, 1.0), **changes)
