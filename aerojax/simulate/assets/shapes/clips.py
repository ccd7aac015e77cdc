"""Things of shapes-10 as clips of single frames: Gaussians of their surfaces, as ModelSplat has its objects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from aerojax.core.claims import claim
from aerojax.core.config import require_at_least, to_mapping
from aerojax.core.errors import UserError
from aerojax.core.seeds import seed_of
from aerojax.data.clips import RECORD, save_clip
from aerojax.data.imports.modelsplat import in_unit_ball
from aerojax.data.splits import SPLITS
from aerojax.simulate.assets.animated import animated_asset
from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.assets.paint.patterns import ROLES
from aerojax.simulate.assets.shapes.kinds import KINDS, SHAPES_10
from aerojax.simulate.assets.solids.asset import refined
from aerojax.simulate.surface import SurfaceConfig, draw_surface_points, surface_gaussians
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from aerojax.simulate.usd.authoring import Asset

_EDGE = 0.1
"""Metres: longest edge of a face, which has one colour."""


@dataclass(frozen=True)
class ShapesConfig:
    """The clips of shapes-10.

    per_class: things of each kind, by split; more of them leave those before as they are.
    tokens: Gaussians of one.
    versions: draws of a training thing's Gaussians, of which training takes another one in every epoch.
    thickness: of the Gaussians, as in `SurfaceConfig`.
    seed: of everything.
    """

    per_class: dict[str, int] = field(default_factory=lambda: {"train": 40, "val": 10, "test": 20})
    tokens: int = 1024
    versions: int = 5
    thickness: float = SurfaceConfig.thickness
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what cannot be made."""
        require_at_least(self, "tokens", "versions")
        if set(self.per_class) - set(SPLITS) or min(self.per_class.values(), default=0) < 0:
            problem = f"per_class is {self.per_class}"
            raise UserError("invalid", problem, f"give numbers of {', '.join(SPLITS)}, none below 0")


def build_shape(name: str) -> AnimatedMesh:
    """A thing by its name, `<kind>_<anything>`, which decides its proportions and colours."""
    rng = np.random.default_rng(seed_of("aerojax", "shapes-10", name))
    mesh = refined(KINDS[name.partition("_")[0]](rng), _EDGE)
    part = Part("thing", mesh, int(rng.integers(ROLES)))
    return animated_asset(Asset((part,)), name, seed_of("colours", name))


def shape_columns(name: str, versions: int, config: ShapesConfig) -> Float32[np.ndarray, "version token 14"]:
    """Draws of the Gaussians of a thing's surface in random order, each in the unit ball about their mean."""
    mesh = build_shape(name)
    vertices = mesh.vertices_at(0.0).astype(np.float64)
    drawn = (draw_surface_points(mesh, config.tokens, seed_of(name, number)) for number in range(versions))
    found = (surface_gaussians(vertices, mesh.faces, points, thickness=config.thickness) for points in drawn)
    rng = np.random.default_rng(seed_of("order", name))
    return np.stack([rng.permutation(in_unit_ball(one.columns)) for one in found])


def make_shapes(config: ShapesConfig, folder: Path, *, progress: Callable[[int, int, str], None]) -> dict[str, int]:
    """Make the clips that are missing, `<folder>/<split>/<kind>_<split>_<number>.npz`; how many there are by split.

    Raises:
        UserError: the folder holds clips of another configuration.
    """
    claim(folder / RECORD, to_mapping(config), ignoring=("per_class",))
    jobs = [
        (split, kind, f"{kind}_{split}_{config.seed}_{number:04d}")
        for split, count in config.per_class.items()
        for number in range(count)
        for kind in SHAPES_10
    ]
    for done, (split, kind, name) in enumerate(jobs, start=1):
        path = folder / split / f"{name}.npz"
        if not path.exists():
            columns = shape_columns(name, config.versions if split == "train" else 1, config)
            save_clip(path, columns, kind, name, classes=SHAPES_10)
        progress(done, len(jobs), f"clips in {folder}")
    return {split: count * len(SHAPES_10) for split, count in config.per_class.items()}
