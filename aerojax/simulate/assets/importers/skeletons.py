"""Skins and morph targets of an imported scene as UsdSkel skeletons, animations and blend shapes.

A skeleton's joints are the skin's nodes and every node between them and their common ancestor, below which the skeleton
hangs: each joint then has exactly its node's translation, rotation and scale, and nothing is baked.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from aerojax.simulate.assets.importers.motion import key_times, values_at
from aerojax.simulate.assets.importers.scene import ImportedScene, Node, Quantity, Skin, Surface
from aerojax.simulate.usd.authoring import TIME_CODES_PER_SECOND, row_matrix


def node_names(nodes: Sequence[Node]) -> tuple[str, ...]:
    """A prim name for every node, unique in the whole model."""
    names: list[str] = []
    taken: set[str] = set()
    last: dict[str, int] = {}
    for node in nodes:
        base = re.sub(r"\W", "_", node.name, flags=re.ASCII) or "node"
        base = f"_{base}" if base[0].isdigit() else base
        name, number = base, last.get(base, 0)
        while name in taken:
            number += 1
            name = f"{base}_{number}"
        last[base] = number
        taken.add(name)
        names.append(name)
    return tuple(names)


def local_matrix(node: Node) -> Float[np.ndarray, "4 4"]:
    """`parent_from_node` at rest, acting on columns."""
    matrix = np.eye(4)
    turn = np.array(Gf.Matrix3d(Gf.Quatd(*node.rotation).GetNormalized())).T  # USD matrices act on rows
    matrix[:3, :3], matrix[:3, 3] = turn * np.asarray(node.scale), node.translation
    return matrix


@dataclass(frozen=True)
class Bones:
    """The joints of one skeleton.

    holder: node that the skeleton hangs below, -1 for the model itself.
    joints: nodes, parents first. paths: their names with their ancestors, as UsdSkel has them.
    """

    holder: int
    joints: tuple[int, ...]
    paths: tuple[str, ...]


def skeleton_bones(names: tuple[str, ...], scene: ImportedScene, skin: Skin) -> Bones:
    """The skin's nodes and those above them, up to the nearest one that is above all."""
    chains = [_ancestors(scene.nodes, joint) for joint in skin.joints]
    holder = max(set.intersection(*(set(chain) for chain in chains)))  # a child's index is above its parent's
    joints = sorted(
        {n for joint, chain in zip(skin.joints, chains, strict=True) for n in (joint, *chain) if n > holder}
    )
    paths: dict[int, str] = {}
    for joint in joints:
        above = paths.get(scene.nodes[joint].parent)
        if above is not None or scene.nodes[joint].parent == holder:
            paths[joint] = names[joint] if above is None else f"{above}/{names[joint]}"
    return Bones(holder, tuple(paths), tuple(paths.values()))


def _ancestors(nodes: Sequence[Node], index: int) -> list[int]:
    """Nodes above one, and -1 for the model."""
    chain = []
    while index >= 0:
        index = nodes[index].parent
        chain.append(index)
    return chain


def write_skeleton(
    stage: Usd.Stage, path: Sdf.Path, scene: ImportedScene, bones: Bones, skin: Skin, morphed: Sequence[tuple[str, int]]
) -> UsdSkel.Skeleton:
    """Author a skeleton and the animation of its joints and of the morphed nodes that hang on it.

    Args:
        stage: to write to.
        path: of the skeleton.
        scene: whose nodes are the joints.
        bones: which nodes.
        skin: gives the joints' bind transforms.
        morphed: prim name and index of every node whose morph targets this skeleton drives.
    """
    skeleton = UsdSkel.Skeleton.Define(stage, path)
    skeleton.CreateJointsAttr(list(bones.paths))
    rest = [local_matrix(scene.nodes[joint]) for joint in bones.joints]
    skeleton.CreateRestTransformsAttr([row_matrix(m) for m in rest])
    bind = _chained(scene, bones, rest)
    for joint, matrix in zip(skin.joints, skin.joint_from_mesh, strict=True):
        bind[bones.joints.index(joint)] = np.linalg.inv(matrix)
    skeleton.CreateBindTransformsAttr([row_matrix(m) for m in bind])
    animation = UsdSkel.Animation.Define(stage, path.AppendChild("clip"))
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    animation.CreateJointsAttr(list(bones.paths))
    _write_joints(animation, scene, bones)
    _write_morph_weights(animation, scene, morphed)
    return skeleton


def write_morph_driver(
    stage: Usd.Stage, path: Sdf.Path, scene: ImportedScene, morphed: Sequence[tuple[str, int]]
) -> UsdSkel.Skeleton:
    """A skeleton of one still joint, whose animation drives meshes that are morphed but not skinned."""
    skeleton = UsdSkel.Skeleton.Define(stage, path)
    skeleton.CreateJointsAttr(["root"])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(1.0)])
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(1.0)])
    animation = UsdSkel.Animation.Define(stage, path.AppendChild("clip"))
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    _write_morph_weights(animation, scene, morphed)
    return skeleton


def _chained(scene: ImportedScene, bones: Bones, rest: list[np.ndarray]) -> list[np.ndarray]:
    """`skeleton_from_joint` at rest."""
    found: list[np.ndarray] = []
    for joint, local in zip(bones.joints, rest, strict=True):
        parent = scene.nodes[joint].parent
        found.append(found[bones.joints.index(parent)] @ local if parent in bones.joints else local)
    return found


def _write_joints(animation: UsdSkel.Animation, scene: ImportedScene, bones: Bones) -> None:
    still = [scene.nodes[joint] for joint in bones.joints]
    for times, value in _samples(scene, bones, "translation", np.array([n.translation for n in still])):
        animation.CreateTranslationsAttr().Set(Vt.Vec3fArray.FromNumpy(value.astype(np.float32)), times)
    for times, value in _samples(scene, bones, "rotation", np.array([n.rotation for n in still])):
        animation.CreateRotationsAttr().Set([Gf.Quatf(*q) for q in value.tolist()], times)
    for times, value in _samples(scene, bones, "scale", np.array([n.scale for n in still])):
        animation.CreateScalesAttr().Set(
            [Gf.Vec3h(*s) for s in value.tolist()], times
        )  # USD keeps them in half precision


def _samples(
    scene: ImportedScene, bones: Bones, quantity: Quantity, still: Float[np.ndarray, "joint component"]
) -> list[tuple[Usd.TimeCode, Float[np.ndarray, "joint component"]]]:
    """One quantity of all joints at every time that any of them needs; the default time where none moves."""
    place = {joint: k for k, joint in enumerate(bones.joints)}
    tracks = [t for t in scene.tracks if t.node in place and t.quantity == quantity]
    if not tracks:
        return [(Usd.TimeCode.Default(), still)]
    times = key_times(tracks)
    values = np.repeat(still[None], len(times), axis=0)
    for track in tracks:
        values[:, place[track.node]] = values_at(track, times)
    return [(_code(t), v) for t, v in zip(times.tolist(), values, strict=True)]


def _code(seconds: float) -> Usd.TimeCode:
    return Usd.TimeCode(seconds * TIME_CODES_PER_SECOND)


def target_count(node: Node) -> int:
    """Morph targets of a node's surfaces."""
    return max((len(s.morphs) for s in node.surfaces), default=0)


def target_names(name: str, count: int) -> list[str]:
    """What the morph targets of a node are called, in its meshes and in the animation."""
    return [f"{name}_target_{k}" for k in range(count)]


def _write_morph_weights(
    animation: UsdSkel.Animation, scene: ImportedScene, morphed: Sequence[tuple[str, int]]
) -> None:
    counts = [target_count(scene.nodes[i]) for _, i in morphed]
    if not sum(counts):
        return
    names = [name for (node, _), c in zip(morphed, counts, strict=True) for name in target_names(node, c)]
    animation.CreateBlendShapesAttr(names)
    tracks = {t.node: t for t in scene.tracks if t.quantity == "weights"}
    driven = [tracks[i] for _, i in morphed if i in tracks]
    times = key_times(driven) if driven else np.zeros(1)
    columns = []
    for (_, index), count in zip(morphed, counts, strict=True):
        still = np.resize(np.asarray(scene.nodes[index].morph_weights or (0.0,) * count, np.float64), count)
        columns.append(values_at(tracks[index], times) if index in tracks else np.tile(still, (len(times), 1)))
    weights = animation.CreateBlendShapeWeightsAttr()
    for seconds, row in zip(times.tolist(), np.concatenate(columns, axis=1).astype(np.float32), strict=True):
        weights.Set(Vt.FloatArray.FromNumpy(row), _code(seconds) if driven else Usd.TimeCode.Default())


def bind_skin(mesh: UsdGeom.Mesh, surface: Surface, skin: Skin, bones: Bones) -> None:
    """Give a mesh its joints and weights; the skin's joint numbers become the skeleton's."""
    assert surface.joints is not None and surface.weights is not None
    number = np.array([bones.joints.index(j) for j in skin.joints], np.int32)
    width = surface.joints.shape[1]
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    indices = Vt.IntArray.FromNumpy(np.ascontiguousarray(number[surface.joints].reshape(-1)))
    binding.CreateJointIndicesPrimvar(False, width).Set(indices)
    weights = Vt.FloatArray.FromNumpy(np.ascontiguousarray(surface.weights.reshape(-1)))
    binding.CreateJointWeightsPrimvar(False, width).Set(weights)
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))


def bind_morphs(stage: Usd.Stage, mesh: UsdGeom.Mesh, surface: Surface, name: str) -> None:
    """Author the morph targets of a mesh, each with the points that it moves."""
    if not surface.morphs:
        return
    names, paths = target_names(name, len(surface.morphs)), []
    for target, offsets in zip(names, surface.morphs, strict=True):
        shape = UsdSkel.BlendShape.Define(stage, mesh.GetPath().AppendChild(target))
        moved = np.flatnonzero(np.any(offsets != 0, axis=1))
        shape.CreatePointIndicesAttr(Vt.IntArray.FromNumpy(moved.astype(np.int32)))
        shape.CreateOffsetsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(offsets[moved])))
        paths.append(shape.GetPath())
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateBlendShapesAttr(names)
    binding.CreateBlendShapeTargetsRel().SetTargets(paths)
