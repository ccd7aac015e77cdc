"""Objects that reconstructors are measured on: test identities with their textures, and models from any folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.simulate.assets.catalogue import build_identity, identities
from aerojax.simulate.assets.importers.convert import convert_model
from aerojax.simulate.assets.importers.models import GLTF, MESHES, USD, WAVEFRONT, ImportedModel
from aerojax.simulate.usd.animated_mesh import AnimatedMesh, load_animated_mesh


@dataclass(frozen=True, eq=False)
class Subject:
    """One object in one pose. kind: its class, or "model". seconds: of its animation."""

    name: str
    kind: str
    mesh: AnimatedMesh
    seconds: float

    def posed(self) -> tuple[Float64[np.ndarray, "vertex 3"], Float64[np.ndarray, "3"], float]:
        """Vertices that faces use, metres, body frame; the middle of their bounding box; their reach from there."""
        vertices = self.mesh.vertices_at(self.seconds).astype(np.float64)[np.unique(self.mesh.faces)]
        middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        return vertices, middle, float(np.linalg.norm(vertices - middle, axis=1).max())


def test_subjects(count: int, assets: Path) -> tuple[Subject, ...]:
    """The first test identities, classes in turn, each at a moment of its own; built in `assets` unless they are there.

    Args:
        count: how many; more extend the list.
        assets: folder of stages and textures.
    """
    chosen = identities("test", -(-count // len(CLASSES)))[:count]
    return tuple(
        _subject(one.name, one.label, load_animated_mesh(build_identity(one, assets)), index)
        for index, one in enumerate(chosen)
    )


def model_subjects(folder: Path, assets: Path, most: int | None = None) -> tuple[Subject, ...]:
    """Every model file in a folder, in the order of their names; size and orientation do not matter.

    Args:
        folder: holds `.glb`, `.gltf`, `.obj`, `.stl`, `.ply` or USD files.
        assets: where they are converted to stages.
        most: how many at most.

    Raises:
        UserError: the folder holds none, or one of them cannot be read.
    """
    files = sorted(path for path in folder.glob("*") if path.suffix.lower() in GLTF + WAVEFRONT + MESHES + USD)
    if not files:
        raise UserError(
            "missing", f"models={folder} holds no model", "name a folder of glTF, OBJ, STL, PLY or USD files"
        )
    return tuple(_imported(path, assets, index) for index, path in enumerate(files[:most]))


def _imported(file: Path, assets: Path, index: int) -> Subject:
    kind = file.suffix.lower()
    up = "" if kind in USD else "+Y" if kind in GLTF + WAVEFRONT else "+Z"
    model = ImportedModel(file.stem, file.resolve(), CLASSES[0], "test", "+X", up, 1.0, "first", 1.0, "", str(file))
    stage = assets / f"{file.stem}.usdc"
    convert_model(model, stage)
    return _subject(file.stem, "model", load_animated_mesh(stage, called=str(file)), index)


def _subject(name: str, kind: str, mesh: AnimatedMesh, index: int) -> Subject:
    golden = 0.6180339887498949  # shares of the cycle that never come near each other
    return Subject(name, kind, mesh, (index * golden % 1.0) * mesh.cycle_seconds)
