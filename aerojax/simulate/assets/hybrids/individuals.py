"""Training individuals beyond the published split: any number a class, each from its seed alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.airplanes.asset import build_airplane
from aerojax.simulate.assets.birds.asset import LEVEL_HEAD, build_bird
from aerojax.simulate.assets.helicopters.asset import build_helicopter
from aerojax.simulate.assets.hybrids.airplanes import draw_hybrid_airplane
from aerojax.simulate.assets.hybrids.birds import draw_hybrid_bird
from aerojax.simulate.assets.hybrids.helicopters import draw_hybrid_helicopter
from aerojax.simulate.assets.hybrids.multicopters import draw_hybrid_multicopter
from aerojax.simulate.assets.hybrids.poses import closed, draw_pose, draw_wings, held
from aerojax.simulate.assets.hybrids.variations import VariationConfig, angular, draw_factors, varied
from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.assets.mesh.shapes import Mesh, ellipsoid
from aerojax.simulate.assets.multicopters.asset import build_multicopter
from aerojax.simulate.usd.authoring import Asset, normalised
from aerojax.simulate.usd.skeletons import Skeleton, SkinnedAsset, SkinnedPart, rescaled

HYBRID = "hybrid"
"""The family of individuals that mix the training families of their class."""


def hybrid_asset(label: str, seed: int) -> Asset | SkinnedAsset:
    """Draw, build and vary an individual of mixed training families; its size is that of the class's families.

    Args:
        label: one of `aerojax.core.types.CLASSES`.
        seed: of everything but the colours.
    """
    rng, config = np.random.default_rng(seed), VariationConfig()
    if label == "bird":
        return _hybrid_bird(config, rng)
    if label == "drone":
        asset = varied(build_multicopter(draw_hybrid_multicopter(rng), rng), label, config, rng)
        hubs = np.array([part.spin.hub[:2] for part in asset.parts if part.spin is not None])
        return normalised(asset, float(np.linalg.norm(hubs[:, None] - hubs[None], axis=-1).max()))
    if label == "helicopter":
        asset = varied(build_helicopter(draw_hybrid_helicopter(rng), rng), label, config, rng)
        body = [p.mesh.points for p in asset.parts if p.spin is None and p.name != "load"]
        return normalised(asset, float(np.ptp(np.concatenate(body)[:, 0])))
    asset = varied(build_airplane(draw_hybrid_airplane(rng), rng), label, config, rng)
    wings = next(part.mesh.points for part in asset.parts if part.name == "wings")
    return normalised(asset, float(np.ptp(wings[:, 1])))


def _hybrid_bird(config: VariationConfig, rng: np.random.Generator) -> SkinnedAsset:
    parameters, pose = draw_hybrid_bird(rng), draw_pose(rng)
    parameters = replace(parameters, shape=closed(parameters.shape, pose, rng))
    asset = build_bird(parameters)
    if pose != "beating":
        shape = parameters.shape
        lean = shape.body_pitch if pose in ("folded", "perched") else 0.0
        motion = held(draw_wings(pose, rng), LEVEL_HEAD * shape.body_pitch, lean)
        asset = replace(asset, motion=motion)
    if rng.random() < config.loaded:
        asset = replace(asset, parts=(*asset.parts, _prey(asset, rng)))
    asset = _stretched(asset, draw_factors(config, rng))
    if rng.random() < config.angular:
        asset = _angular(asset, float(rng.uniform(*config.cell)))
    wing = next(s.part.mesh.points for s in asset.parts if s.part.name == "wing_left")
    return rescaled(asset, 0.5 / float(wing[:, 1].max()))


def _prey(asset: SkinnedAsset, rng: np.random.Generator) -> SkinnedPart:
    """What a bird carries under its trunk: a fish or a bundle."""
    trunk = asset.parts[0].part.mesh.points
    size, x = float(rng.uniform(0.04, 0.1)), float(trunk[:, 0].mean())
    low = float(trunk[np.abs(trunk[:, 0] - x).argsort()[:32], 2].min())
    mesh = ellipsoid((x, 0.0, low - 0.3 * size), (size, 0.35 * size, 0.4 * size), 7, 10)
    weights = np.zeros((len(mesh.points), len(asset.skeleton.paths)))
    weights[:, 0] = 1.0
    return SkinnedPart(Part("load", mesh, 6), weights)


def _stretched(asset: SkinnedAsset, factors: Float[np.ndarray, "3"]) -> SkinnedAsset:
    """Stretch the rest pose, its joints and the shifts of the body."""
    parts = tuple(
        replace(s, part=replace(s.part, mesh=Mesh(s.part.mesh.points * factors, s.part.mesh.faces)))
        for s in asset.parts
    )
    skeleton = Skeleton(asset.skeleton.paths, asset.skeleton.pivots * factors)
    return SkinnedAsset(parts, skeleton, replace(asset.motion, shift=asset.motion.shift * factors))


def _angular(asset: SkinnedAsset, cell: float) -> SkinnedAsset:
    """Few large facets; joined points take the mean of their weights."""
    parts = []
    for skinned in asset.parts:
        mesh, which = angular(skinned.part.mesh, cell)
        count = np.bincount(which)[:, None]
        weights = np.stack([np.bincount(which, column) for column in skinned.weights.T], axis=1) / count
        parts.append(SkinnedPart(replace(skinned.part, mesh=mesh), weights))
    return replace(asset, parts=tuple(parts))
