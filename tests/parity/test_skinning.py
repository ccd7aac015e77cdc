"""UsdSkel's skinning against linear blending written out from the stage's own joints, weights and samples."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdSkel
from scipy.spatial.transform import Rotation, Slerp

from aerojax.simulate.assets import catalogue
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

BIRDS = [i for i in catalogue.identities("test", 3) if i.label == "bird"]


def _interpolated(attribute, time, turn):
    """Value between the two samples around a time code; quaternions (x, y, z, w) by spherical interpolation."""
    _, low, high = True, *attribute.GetBracketingTimeSamples(time)
    first, second = attribute.Get(low), attribute.Get(high)
    share = 0.0 if high == low else (time - low) / (high - low)
    if not turn:
        return (1 - share) * np.array(first) + share * np.array(second)
    pairs = [[(*q.imaginary, q.real) for q in values] for values in (first, second)]
    steps = zip(*pairs, strict=True)
    return [Slerp([0, 1], Rotation.from_quat([a, b]))(share).as_matrix() for a, b in steps]


def _blend(stage, seconds):
    """Skinned points of every mesh from raw attributes, column vectors throughout."""
    skeleton = UsdSkel.Skeleton(next(p for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)))
    animation = UsdSkel.Animation(next(p for p in stage.Traverse() if p.IsA(UsdSkel.Animation)))
    joints = list(skeleton.GetJointsAttr().Get())
    time = seconds * stage.GetTimeCodesPerSecond()
    rotation = _interpolated(animation.GetRotationsAttr(), time, True)
    translation = _interpolated(animation.GetTranslationsAttr(), time, False)
    world = []
    for joint, turn, shift in zip(joints, rotation, translation, strict=True):
        local = np.eye(4)
        local[:3, :3], local[:3, 3] = turn, shift
        parent = joint.rpartition("/")[0]
        world.append(world[joints.index(parent)] @ local if parent else local)
    bind = [np.array(m).T for m in skeleton.GetBindTransformsAttr().Get()]
    skin = np.stack([w @ np.linalg.inv(b) for w, b in zip(world, bind, strict=True)])
    posed = []
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            binding = UsdSkel.BindingAPI(prim)
            width = binding.GetJointIndicesPrimvar().GetElementSize()
            index = np.array(binding.GetJointIndicesPrimvar().Get()).reshape(-1, width)
            weight = np.array(binding.GetJointWeightsPrimvar().Get()).reshape(-1, width)
            assert weight.sum(1) == pytest.approx(1.0, abs=1e-5)
            points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get())
            homogeneous = np.concatenate([points, np.ones((len(points), 1))], axis=1)
            posed.append(np.einsum("vk,vkij,vj->vi", weight, skin[index], homogeneous)[:, :3])
    return np.concatenate(posed)


@pytest.mark.parametrize("identity", BIRDS, ids=[i.name for i in BIRDS])
def test_stage_skinning_equals_linear_blending(identity, tmp_path):
    path = catalogue.build_identity(identity, tmp_path)
    mesh, stage = load_animated_mesh(path), Usd.Stage.Open(str(path))
    for seconds in (0.0, 0.0137, 0.211, 0.83 * mesh.cycle_seconds):
        assert mesh.vertices_at(seconds) == pytest.approx(_blend(stage, seconds), abs=3e-4)


def test_extent_holds_every_pose(tmp_path):
    """To 15 mm: between samples USD interpolates the extent linearly while wings move on arcs."""
    path = catalogue.build_identity(BIRDS[0], tmp_path)
    mesh, stage = load_animated_mesh(path), Usd.Stage.Open(str(path))
    root = UsdSkel.Root(next(p for p in stage.Traverse() if p.IsA(UsdSkel.Root)))
    for seconds in np.linspace(0, mesh.cycle_seconds, 40):
        low, high = np.array(root.GetExtentAttr().Get(float(seconds) * stage.GetTimeCodesPerSecond()))
        vertices = mesh.vertices_at(float(seconds))
        assert (vertices >= low - 0.015).all() and (vertices <= high + 0.015).all()
