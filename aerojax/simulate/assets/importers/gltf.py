"""A glTF document as an imported scene: nodes, copies, skins and animation.

Read here and not with trimesh, which leaves out skins, morph targets and animations.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.gltf_animation import clips, tracks_of
from aerojax.simulate.assets.importers.gltf_document import Document, image_bytes, read_accessor, read_document
from aerojax.simulate.assets.importers.gltf_surfaces import mesh_surfaces
from aerojax.simulate.assets.importers.scene import ImportedScene, Node, Skin, Surface, Track
from aerojax.simulate.usd.placements import MOST_COPIES

SHEAR = 1e-3
"""Cosine between a matrix's axes above which it is no translation, rotation and scale."""
_INSTANCING = "EXT_mesh_gpu_instancing"


def load_gltf(path: Path, animation: int | str | None) -> ImportedScene:
    """Read the default scene of a `.glb` or `.gltf`.

    Args:
        path: the file.
        animation: index or name of the clip; "first" for the first one, if there is one, with all those that move other
            nodes (exporters write one clip a rotor); None for a still model.

    Raises:
        UserError: if the file is broken, needs an extension that is not read, or lacks the clip.
    """
    document = read_document(path)
    try:
        return _scene(document, animation)
    except UserError:
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise UserError(
            "invalid", f"{path}: a field of this glTF file is not as the format says ({error!r})", "export it again"
        ) from error


def _scene(document: Document, animation: int | str | None) -> ImportedScene:
    parents = _parents(document)
    place = {node: i for i, node in enumerate(parents)}
    skins = _used_skins(document, place)
    surfaces: dict[int, tuple[Surface, ...]] = {}
    nodes = [_node(document, index, -1 if p is None else place[p], skins, surfaces) for index, p in parents.items()]
    tracks, seconds = tracks_of(document, clips(document, animation), place, nodes)
    nodes = _without_hidden(document, list(parents), nodes, tracks)
    nodes, tracks = _copied(document, list(parents), nodes, tracks)
    return ImportedScene(
        nodes=tuple(nodes),
        skins=tuple(_skin(document, number, place, nodes, row) for row, number in enumerate(skins)),
        textures=_textures(document, nodes),
        tracks=tuple(tracks),
        seconds=seconds,
    )


def _textures(document: Document, nodes: Sequence[Node]) -> tuple[bytes, ...]:
    """Encoded images, empty where nothing shows them."""
    shown = {s.material.texture for node in nodes for s in node.surfaces if s.st is not None}
    return tuple(image_bytes(document, i) if i in shown else b"" for i in range(len(document.items("images"))))


def _parents(document: Document) -> dict[int, int | None]:
    """Nodes of the default scene, parents first, with their parents."""
    nodes, scenes = document.items("nodes"), document.items("scenes")
    children = {child for node in nodes for child in node.get("children", [])}
    if scenes:
        roots = document.entry("scenes", document.json.get("scene", 0), "scene").get("nodes", [])
    else:
        roots = [i for i in range(len(nodes)) if i not in children]
    found: dict[int, int | None] = {}
    waiting: deque[tuple[Any, int | None]] = deque((root, None) for root in roots)
    while waiting:
        node, parent = waiting.popleft()
        entry = document.entry("nodes", node, "scenes[…].nodes" if parent is None else f"nodes[{parent}].children")
        if node in found:
            raise UserError("mismatch", f"{document.path}: nodes[{node}] has two parents", "export the model again")
        found[node] = parent
        if len(found) > MOST_COPIES:
            raise document.error(f"the scene has more than {MOST_COPIES} nodes", "merge them into fewer meshes")
        waiting.extend((child, node) for child in entry.get("children", []))
    return found


def _used_skins(document: Document, place: dict[int, int]) -> list[int]:
    """Skins of the scene's nodes; those of other scenes have no joints here."""
    nodes = document.items("nodes")
    named = [nodes[i]["skin"] for i in place if "skin" in nodes[i] and "mesh" in nodes[i]]
    for skin in named:
        document.entry("skins", skin, "nodes[…].skin")
    return sorted(set(named))


def _node(document: Document, index: int, parent: int, skins: list[int], known: dict[int, tuple[Surface, ...]]) -> Node:
    """A node with its mesh; `known` holds the meshes that were read before."""
    entry, where = document.items("nodes")[index], f"nodes[{index}]"
    translation, rotation, scale = _local(document, entry, where)
    mesh, number = {}, entry.get("mesh")
    if number is not None:
        mesh = document.entry("meshes", number, f"{where}.mesh")
        if number not in known:
            known[number] = mesh_surfaces(document, number, f"{where}.mesh")
    surfaces = known[number] if number is not None else ()
    skin = skins.index(entry["skin"]) if "skin" in entry and surfaces else None
    if skin is not None and any(surface.joints is None for surface in surfaces):
        raise document.error(f"{where} has a skin, but meshes[{number}] no JOINTS_0 and WEIGHTS_0")
    targets = max((len(s.morphs) for s in surfaces), default=0)
    weights = (*entry.get("weights", mesh.get("weights", ())), *[0.0] * targets)[:targets]
    return Node(
        name=str(entry.get("name", f"node_{index}")),
        parent=parent,
        translation=(translation[0], translation[1], translation[2]),
        rotation=rotation,
        scale=(scale[0], scale[1], scale[2]),
        surfaces=surfaces,
        skin=skin,
        morph_weights=document.vector({"weights": weights}, "weights", (0.0,) * targets, where),
    )


def _local(document: Document, entry: dict[str, Any], where: str) -> tuple[Any, Any, Any]:
    """Translation, rotation (w, x, y, z, unit) and scale."""
    if "matrix" in entry:
        values = document.vector(entry, "matrix", (0.0,) * 16, where)
        return _taken_apart(document, np.array(values).reshape(4, 4).T, where)
    x, y, z, w = document.vector(entry, "rotation", (0.0, 0.0, 0.0, 1.0), where)
    length = float(np.linalg.norm([x, y, z, w]))
    if not length > 0:
        raise document.error(f"{where}.rotation is zero")
    scale = document.vector(entry, "scale", (1.0, 1.0, 1.0), where)
    translation = document.vector(entry, "translation", (0.0, 0.0, 0.0), where)
    return translation, tuple(v / length for v in (w, x, y, z)), scale


def _taken_apart(document: Document, matrix: Float[np.ndarray, "4 4"], where: str) -> tuple[Any, Any, Any]:
    """A matrix's translation, rotation and scale; axes of no length, which flatten, get any direction that fits."""
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = matrix[:3, :3] / np.where(scale > 0, scale, 1.0)
    apart = axes.T @ axes - np.diag((scale > 0).astype(float))
    if np.abs(apart).max() > SHEAR:
        raise document.error(f"{where}.matrix shears, which no node can", "apply the transform to the mesh")
    lost = np.flatnonzero(scale == 0)
    free = np.linalg.svd(axes)[0][:, 3 - len(lost) :]  # perpendicular to the axes that are left
    axes[:, lost] = free
    if np.linalg.det(axes) < 0:
        axis = lost[0] if len(lost) else 0
        axes[:, axis] *= -1
        scale[axis] *= -1
    return tuple(matrix[:3, 3].tolist()), quaternion(axes), tuple(scale.tolist())


def quaternion(rotation: Float[np.ndarray, "3 3"]) -> tuple[float, float, float, float]:
    """Unit quaternion w, x, y, z of a rotation: the largest eigenvector of Bar-Itzhack's symmetric matrix (2000)."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    lower = [
        [a - e - i, 0, 0, 0],
        [b + d, e - a - i, 0, 0],
        [c + g, f + h, i - a - e, 0],
        [h - f, c - g, d - b, a + e + i],
    ]
    x, y, z, w = np.linalg.eigh(np.array(lower, np.float64))[1][:, -1].tolist()
    return w, x, y, z


def _without_hidden(document: Document, order: list[int], nodes: list[Node], tracks: Sequence[Track]) -> list[Node]:
    """Nodes without the meshes that KHR_node_visibility hides, or that a scale shrinks to a line or a point for good.

    The nodes stay: they may be joints.
    """
    grows = {t.node for t in tracks if t.quantity == "scale"}
    unseen, shrunk, found = [], [], []
    for i, node in enumerate(nodes):
        entry = document.items("nodes")[order[i]].get("extensions", {}).get("KHR_node_visibility", {})
        above = node.parent >= 0
        unseen.append(entry.get("visible", True) is False or (above and unseen[node.parent]))
        shrunk.append((sum(s == 0 for s in node.scale) > 1 and i not in grows) or (above and shrunk[node.parent]))
        gone = unseen[i] or (shrunk[i] and node.skin is None)
        found.append(replace(node, surfaces=(), skin=None, morph_weights=()) if gone else node)
    return found


def _copied(
    document: Document, order: list[int], nodes: list[Node], tracks: Sequence[Track]
) -> tuple[list[Node], list[Track]]:
    """Nodes with one child for each copy that EXT_mesh_gpu_instancing makes of a mesh, and tracks of their weights."""
    found, moved = list(nodes), list(tracks)
    for i, index in enumerate(order):
        extension = document.items("nodes")[index].get("extensions", {}).get(_INSTANCING)
        if extension is None or not nodes[i].surfaces:
            continue
        if nodes[i].skin is not None:
            raise document.error(f"nodes[{index}] has a skin and {_INSTANCING}", "export copies as nodes")
        found[i] = replace(nodes[i], surfaces=(), morph_weights=())
        for copy in _instances(document, extension.get("attributes", {}), f"nodes[{index}].{_INSTANCING}"):
            moved += [replace(t, node=len(found)) for t in tracks if t.node == i and t.quantity == "weights"]
            found.append(replace(nodes[i], name=nodes[i].name, parent=i, **copy))
        moved = [t for t in moved if t.node != i or t.quantity != "weights"]
    return found, moved


def _instances(document: Document, attributes: dict[str, Any], where: str) -> list[dict[str, Any]]:
    """Translation, rotation and scale of each copy."""
    known = {
        "TRANSLATION": ("VEC3", (0.0, 0.0, 0.0)),
        "ROTATION": ("VEC4", (0.0, 0.0, 0.0, 1.0)),
        "SCALE": ("VEC3", (1.0, 1.0, 1.0)),
    }
    rows = {
        name: read_accessor(document, attributes[name], f"{where}.{name}", (kind,)).astype(np.float64)
        for name, (kind, _) in known.items()
        if name in attributes
    }
    counts = {len(values) for values in rows.values()}
    if len(counts) > 1:
        raise document.error(f"{where} gives {' and '.join(map(str, sorted(counts)))} copies")
    count = counts.pop() if counts else 0
    if count > MOST_COPIES:
        raise document.error(f"{where} makes {count} copies, more than {MOST_COPIES}", "merge or thin them")
    columns = [rows.get(name, np.tile(default, (count, 1))) for name, (_, default) in known.items()]
    lengths = np.linalg.norm(columns[1], axis=1, keepdims=True)
    if not (lengths > 0).all():
        raise document.error(f"{where}.ROTATION holds a rotation that is zero")
    turns = (columns[1] / lengths)[:, [3, 0, 1, 2]]
    return [
        {"translation": tuple(t), "rotation": tuple(q), "scale": tuple(s)}
        for t, q, s in zip(columns[0].tolist(), turns.tolist(), columns[2].tolist(), strict=True)
    ]


def _skin(document: Document, number: int, place: dict[int, int], nodes: Sequence[Node], row: int) -> Skin:
    """A skin, whose matrices can be inverted; those of joints that move nothing may be anything and become 1."""
    entry, where = document.items("skins")[number], f"skins[{number}]"
    listed = entry.get("joints", [])
    for joint in listed:
        document.entry("nodes", joint, f"{where}.joints")
    if not listed or not all(joint in place for joint in listed):
        raise document.error(f"{where}.joints are none, or not in the scene")
    joints = tuple(place[joint] for joint in listed)
    moving = _moving_joints(document, nodes, row, len(joints), where)
    if "inverseBindMatrices" not in entry:
        return Skin(joints, np.tile(np.eye(4), (len(joints), 1, 1)))
    rows = read_accessor(document, entry["inverseBindMatrices"], f"{where}.inverseBindMatrices", ("MAT4",))
    if len(rows) < len(joints):
        raise document.error(f"{where}.inverseBindMatrices has {len(rows)} elements for {len(joints)} joints")
    matrices = rows[: len(joints)].astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1).copy()
    matrices[:, 3] = [0.0, 0.0, 0.0, 1.0]
    sizes = np.linalg.svd(matrices[:, :3, :3], compute_uv=False)
    for k in np.flatnonzero(~(sizes[:, 2] > 1e-9 * sizes[:, 0])).tolist():
        if k in moving:
            raise document.error(f"{where}.inverseBindMatrices[{k}] is singular, but its joint moves vertices")
        matrices[k] = np.eye(4)
    return Skin(joints, matrices)


def _moving_joints(document: Document, nodes: Sequence[Node], skin: int, count: int, where: str) -> set[int]:
    """Joints that any vertex has a weight of."""
    found: set[int] = set()
    for surface in (s for node in nodes if node.skin == skin for s in node.surfaces):
        assert surface.joints is not None and surface.weights is not None
        used = np.unique(surface.joints[surface.weights > 0])
        if len(used) and used.max() >= count:
            raise document.error(f"JOINTS_0 names joint {used.max()} of the {count} of {where}")
        surface.joints[surface.weights <= 0] = 0  # of no weight, so that any joint will do
        found |= set(used.tolist())
    return found
