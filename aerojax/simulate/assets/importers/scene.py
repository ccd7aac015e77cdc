"""A user's model between its file and its USD stage: nodes, surfaces, materials, skins and one clip of animation.

Frames and units are the file's own. Colours are linear.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

Interpolation = Literal["LINEAR", "STEP", "CUBICSPLINE"]
Quantity = Literal["translation", "rotation", "scale", "weights"]


@dataclass(frozen=True)
class Material:
    """A metallic-roughness material.

    colour: linear, multiplies the texture and the vertices' colours.
    opacity: 0..1, multiplies the texture's alpha where `cutoff` is not None or `blend` holds.
    texture: index of the base colour's image; None without.
    wrap: "repeat", "clamp" or "mirror" along u and v.
    cutoff: alpha below which the surface is open; None without.
    """

    name: str = "plain"
    colour: tuple[float, float, float] = (0.8, 0.8, 0.8)
    opacity: float = 1.0
    metallic: float = 0.0
    roughness: float = 0.7
    texture: int | None = None
    wrap: tuple[str, str] = ("repeat", "repeat")
    cutoff: float | None = None
    blend: bool = False
    double_sided: bool = False


@dataclass(frozen=True)
class Surface:
    """Triangles of one material.

    normals: unit; None means flat faces.
    st: texture coordinates with v upwards, as USD has them.
    colours: linear.
    morphs: offsets of the points at full weight, one a target.
    joints, weights: rows of the skin's joint list, and how much each moves the vertex (rows sum to 1).
    """

    points: Float[np.ndarray, "vertex 3"]
    faces: Int[np.ndarray, "face 3"]
    material: Material
    normals: Float[np.ndarray, "vertex 3"] | None = None
    st: Float[np.ndarray, "vertex 2"] | None = None
    colours: Float[np.ndarray, "vertex 3"] | None = None
    morphs: tuple[Float[np.ndarray, "vertex 3"], ...] = ()
    joints: Int[np.ndarray, "vertex influence"] | None = None
    weights: Float[np.ndarray, "vertex influence"] | None = None


@dataclass(frozen=True)
class Node:
    """A frame of the model; `parent` is -1 at the top, and a node comes after its parent.

    rotation: w, x, y, z, unit.
    morph_weights: of its surfaces' targets, where no clip drives them.
    """

    name: str
    parent: int = -1
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    surfaces: tuple[Surface, ...] = ()
    skin: int | None = None
    morph_weights: tuple[float, ...] = ()


@dataclass(frozen=True)
class Skin:
    """Nodes that move vertices, and what takes the mesh's space to each at rest (acting on columns)."""

    joints: tuple[int, ...]
    joint_from_mesh: Float[np.ndarray, "joint 4 4"]


@dataclass(frozen=True)
class Track:
    """Samples of one quantity of one node.

    seconds: increasing.
    values: rotations are w, x, y, z. Of a cubic spline each key has three rows: in-tangent, value, out-tangent.
    """

    node: int
    quantity: Quantity
    seconds: Float[np.ndarray, "key"]
    values: Float[np.ndarray, "row component"]
    interpolation: Interpolation = "LINEAR"


@dataclass(frozen=True)
class ImportedScene:
    """Everything that is imported from a file; `tracks` start at 0 and end at `seconds`, already at their speed.

    textures: encoded images (PNG, JPEG).
    """

    nodes: tuple[Node, ...]
    skins: tuple[Skin, ...] = ()
    textures: tuple[bytes, ...] = ()
    tracks: tuple[Track, ...] = ()
    seconds: float = 0.0
