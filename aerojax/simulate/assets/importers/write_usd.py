"""Write an imported scene under a prim: its nodes as transforms, its surfaces as meshes, its clip as time samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

from aerojax.simulate.assets.importers.materials import preview_material
from aerojax.simulate.assets.importers.motion import key_times, values_at
from aerojax.simulate.assets.importers.scene import ImportedScene, Material, Node, Surface, Track
from aerojax.simulate.assets.importers.skeletons import (
    Bones,
    bind_morphs,
    bind_skin,
    node_names,
    skeleton_bones,
    write_morph_driver,
    write_skeleton,
)
from aerojax.simulate.assets.importers.textures import Image, mean_colours
from aerojax.simulate.usd.authoring import TIME_CODES_PER_SECOND

Textures = dict[Material, tuple[str, Image]]


@dataclass(frozen=True)
class _Output:
    """What is written to, and what every part of it needs."""

    stage: Usd.Stage
    model: Sdf.Path
    materials: Sdf.Path
    scene: ImportedScene
    textures: Textures
    names: tuple[str, ...]
    paths: dict[int, Sdf.Path]


def write_scene(stage: Usd.Stage, model: Sdf.Path, scene: ImportedScene, textures: Textures) -> None:
    """Author the scene under `model`, which becomes a SkelRoot if anything is skinned or morphed.

    Skins become UsdSkel skeletons and morph targets UsdSkel blend shapes: both are as exact as time-sampled points,
    stay editable and take one copy of the points. Node animation becomes time-sampled transform operations.

    Args:
        stage: to write to; its time codes are `TIME_CODES_PER_SECOND`.
        model: path of the prim that holds everything; materials go to its sibling "materials".
        scene: without mirroring transforms.
        textures: file name (beside the stage) and image of every textured material.
    """
    deformed = any(n.skin is not None or any(s.morphs for s in n.surfaces) for n in scene.nodes)
    (UsdSkel.Root if deformed else UsdGeom.Xform).Define(stage, model)
    output = _Output(
        stage,
        model,
        model.GetParentPath().AppendChild("materials"),
        scene,
        textures,
        node_names(scene.nodes),
        {-1: model},
    )
    bones = tuple(skeleton_bones(output.names, scene, skin) for skin in scene.skins)
    for index in sorted(_drawn(scene, bones)):
        output.paths[index] = output.paths[scene.nodes[index].parent].AppendChild(output.names[index])
        _write_node(output, index)
    _write_skinned(output, bones)
    _write_morphed(output)
    if deformed:
        _write_extents(UsdSkel.Root.Get(stage, model), scene.seconds)


def _drawn(scene: ImportedScene, bones: tuple[Bones, ...]) -> set[int]:
    """Nodes that become prims: those that carry meshes or a skeleton, and what they hang from."""
    wanted = {i for i, node in enumerate(scene.nodes) if node.surfaces and node.skin is None}
    wanted |= {b.holder for b in bones if b.holder >= 0}
    for index in sorted(wanted, reverse=True):
        parent = scene.nodes[index].parent
        while parent >= 0:
            wanted.add(parent)
            parent = scene.nodes[parent].parent
    return wanted


def _write_node(output: _Output, index: int) -> None:
    node = output.scene.nodes[index]
    prim = UsdGeom.Xform.Define(output.stage, output.paths[index])
    _write_transform(prim, node, {t.quantity: t for t in output.scene.tracks if t.node == index})
    if node.skin is None:
        for number, surface in enumerate(node.surfaces):
            _write_surface(output, output.paths[index].AppendChild(f"surface_{number}"), surface)


def _write_transform(prim: UsdGeom.Xform, node: Node, tracks: dict[str, Track]) -> None:
    """Translate, orient and scale, each only if it does anything."""
    double = UsdGeom.XformOp.PrecisionDouble
    if "translation" in tracks or node.translation != (0.0, 0.0, 0.0):
        move = prim.AddTranslateOp(double)
        _write_samples(move, tracks.get("translation"), node.translation, lambda v: Gf.Vec3d(*v))
    if "rotation" in tracks or node.rotation != (1.0, 0.0, 0.0, 0.0):
        turn = prim.AddOrientOp(double)
        _write_samples(turn, tracks.get("rotation"), node.rotation, lambda v: Gf.Quatd(*v))
    if "scale" in tracks or node.scale != (1.0, 1.0, 1.0):
        grow = prim.AddScaleOp(double)
        _write_samples(grow, tracks.get("scale"), node.scale, lambda v: Gf.Vec3d(*v))


def _write_samples(
    operation: UsdGeom.XformOp, track: Track | None, still: tuple[float, ...], kind: Callable[[Sequence[float]], Any]
) -> None:
    if track is None:
        operation.Set(kind(still))
        return
    times = key_times([track])
    for seconds, value in zip(times.tolist(), values_at(track, times).tolist(), strict=True):
        operation.Set(kind(value), seconds * TIME_CODES_PER_SECOND)


def _write_skinned(output: _Output, bones: tuple[Bones, ...]) -> None:
    """Skeletons beside the meshes that they bend; such a mesh's own node does not move it."""
    for number, (bone, skin) in enumerate(zip(bones, output.scene.skins, strict=True)):
        path = output.paths[bone.holder].AppendChild(f"skeleton_{number}")
        bound = [(output.names[i], i) for i, node in enumerate(output.scene.nodes) if node.skin == number]
        skeleton = write_skeleton(output.stage, path, output.scene, bone, skin, bound)
        for name, i in bound:
            for k, surface in enumerate(output.scene.nodes[i].surfaces):
                mesh = _write_surface(output, path.GetParentPath().AppendChild(f"{name}_surface_{k}"), surface)
                bind_skin(mesh, surface, skin, bone)
                bind_morphs(output.stage, mesh, surface, name)
                UsdSkel.BindingAPI(mesh).CreateSkeletonRel().SetTargets([skeleton.GetPath()])


def _write_morphed(output: _Output) -> None:
    """One driver for all meshes that are morphed and not skinned."""
    morphed = [
        (output.names[i], i)
        for i, n in enumerate(output.scene.nodes)
        if n.skin is None and any(s.morphs for s in n.surfaces)
    ]
    if not morphed:
        return
    skeleton = write_morph_driver(output.stage, output.model.AppendChild("morphs"), output.scene, morphed)
    for name, i in morphed:
        for k, surface in enumerate(output.scene.nodes[i].surfaces):
            mesh = UsdGeom.Mesh.Get(output.stage, output.paths[i].AppendChild(f"surface_{k}"))
            bind_morphs(output.stage, mesh, surface, name)
            if surface.morphs:
                UsdSkel.BindingAPI(mesh).CreateSkeletonRel().SetTargets([skeleton.GetPath()])


def _write_surface(output: _Output, path: Sdf.Path, surface: Surface) -> UsdGeom.Mesh:
    """A triangle mesh with normals, texture coordinates, colours, extent and its material."""
    mesh = UsdGeom.Mesh.Define(output.stage, path)
    corners = surface.faces.reshape(-1).astype(np.int32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(surface.points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(surface.faces), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(corners))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(surface.material.double_sided)
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([surface.points.min(0), surface.points.max(0)])))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(_corner_normals(surface)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)
    if surface.st is not None:
        variable = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        )
        variable.Set(Vt.Vec2fArray.FromNumpy(surface.st[corners]))
    texture = output.textures.get(surface.material) if surface.st is not None else None
    _colour(mesh, surface, texture)
    material = preview_material(output.stage, output.materials, surface, None if texture is None else texture[0])
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    return mesh


def _corner_normals(surface: Surface) -> np.ndarray:
    """Unit normals, one a corner; the face's where the file has none or a degenerate one."""
    points = surface.points[surface.faces].astype(np.float64)
    flat = np.repeat(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), 3, axis=0)
    given = flat if surface.normals is None else surface.normals[surface.faces.reshape(-1)].astype(np.float64)
    chosen = np.where(np.linalg.norm(given, axis=1, keepdims=True) > 1e-6, given, flat) if given is not flat else flat
    length = np.linalg.norm(chosen, axis=1, keepdims=True)
    return np.where(length > 0, chosen / np.where(length > 0, length, 1.0), (0.0, 0.0, 1.0)).astype(np.float32)


def _colour(mesh: UsdGeom.Mesh, surface: Surface, texture: tuple[str, Image] | None) -> None:
    """`displayColor`: of the vertices, else the texture's mean on each face, else the material's."""
    if surface.colours is not None:
        kind, values = UsdGeom.Tokens.vertex, surface.colours * np.asarray(surface.material.colour)
    elif texture is not None:
        kind, values = UsdGeom.Tokens.uniform, mean_colours(surface, texture[1])
    else:
        kind, values = UsdGeom.Tokens.constant, np.asarray([surface.material.colour])
    mesh.CreateDisplayColorPrimvar(kind).Set(Vt.Vec3fArray.FromNumpy(values.clip(0, 1).astype(np.float32)))
    if surface.material.opacity < 1.0:
        mesh.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.constant).Set([surface.material.opacity])


def _write_extents(root: UsdSkel.Root, seconds: float) -> None:
    """Bounds over the clip, as UsdSkel computes them from joints and meshes."""
    extent, times = root.CreateExtentAttr(), np.linspace(0.0, seconds, 25 if seconds > 0 else 1)
    for code in (times * TIME_CODES_PER_SECOND).tolist():
        extent.Set(UsdGeom.Boundable.ComputeExtentFromPlugins(root, code), code)
