"""A glTF document as an imported scene: nodes, triangles, materials, skins, morph targets and one animation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.gltf_document import Document, image_bytes, read_accessor, read_document
from aerojax.simulate.assets.importers.scene import ImportedScene, Material, Node, Skin, Surface, Track

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_QUANTITIES = ("translation", "rotation", "scale", "weights")


def load_gltf(path: Path, animation: int | str | None) -> ImportedScene:
    """Read the default scene of a `.glb` or `.gltf`.

    Args:
        path: the file.
        animation: index or name of the clip; "first" for the first one, if there is one; None for a still model.

    Raises:
        UserError: if the file is broken, needs an extension that is not read, or lacks the clip.
    """
    document = read_document(path)
    try:
        order = _order(document)
        place = {node: i for i, node in enumerate(order)}
        clip = _clip(document, animation)
        tracks = () if clip is None else _tracks(document, clip, place)
        return ImportedScene(
            nodes=tuple(_node(document, node, place) for node in order),
            skins=tuple(_skin(document, skin, place) for skin in document.items("skins")),
            textures=tuple(image_bytes(document, i) for i in range(len(document.items("images")))),
            tracks=tracks,
            seconds=max((float(t.seconds[-1]) for t in tracks), default=0.0),
        )
    except (KeyError, IndexError, TypeError) as error:
        raise UserError(
            "invalid", f"{path}: this glTF file names something that it lacks ({error!r})", "export it again"
        ) from error


def clip_names(document: Document) -> list[str]:
    """Names of the animations, in order; numbers where they have none."""
    return [str(clip.get("name", i)) for i, clip in enumerate(document.items("animations"))]


def _clip(document: Document, animation: int | str | None) -> dict[str, Any] | None:
    names = clip_names(document)
    if animation is None or (animation == "first" and not names):
        return None
    animation = 0 if animation == "first" and "first" not in names else animation
    wanted = names.index(animation) if isinstance(animation, str) and animation in names else animation
    if isinstance(wanted, str) or not 0 <= wanted < len(names):
        known = ", ".join(f"{i} ({name})" for i, name in enumerate(names)) or "no clip at all"
        raise UserError(
            "invalid",
            f"{document.path}: animation is {animation!r}, but the file has {known}",
            "use one of them or none",
        )
    return document.items("animations")[wanted]


def _order(document: Document) -> list[int]:
    """Nodes of the default scene, parents first."""
    scenes = document.items("scenes")
    nodes = document.items("nodes")
    children = {child for node in nodes for child in node.get("children", [])}
    roots = scenes[document.json.get("scene", 0)].get("nodes", []) if scenes else set(range(len(nodes))) - children
    order, waiting = [], list(roots)
    while waiting:
        node = waiting.pop(0)
        if node in order:
            raise UserError("mismatch", f"{document.path}: nodes[{node}] has two parents", "export the model again")
        order.append(node)
        waiting.extend(nodes[node].get("children", []))
    return order


def _node(document: Document, index: int, place: dict[int, int]) -> Node:
    entry = document.items("nodes")[index]
    parent = next((i for i in place if index in document.items("nodes")[i].get("children", [])), None)
    translation, rotation, scale = _local(entry)
    mesh = document.items("meshes")[entry["mesh"]] if "mesh" in entry else {}
    surfaces = (_surface(document, primitive) for primitive in mesh.get("primitives", []))
    return Node(
        name=str(entry.get("name", f"node_{index}")),
        parent=-1 if parent is None else place[parent],
        translation=translation,
        rotation=rotation,
        scale=scale,
        surfaces=tuple(s for s in surfaces if s is not None),
        skin=entry.get("skin"),
        morph_weights=tuple(map(float, entry.get("weights", mesh.get("weights", ())))),
    )


def _local(entry: dict[str, Any]) -> tuple[Any, Any, Any]:
    """Translation, rotation (w, x, y, z) and scale; a matrix is taken apart (§3.5.2: it always can be)."""
    if "matrix" not in entry:
        x, y, z, w = map(float, entry.get("rotation", (0, 0, 0, 1)))
        return tuple(map(float, entry.get("translation", (0, 0, 0)))), (w, x, y, z), tuple(
            map(float, entry.get("scale", (1, 1, 1)))
        )  # fmt: skip
    matrix = np.asarray(entry["matrix"], np.float64).reshape(4, 4).T
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    scale[0] *= np.sign(np.linalg.det(matrix[:3, :3])) or 1.0
    return tuple(matrix[:3, 3].tolist()), quaternion(matrix[:3, :3] / scale), tuple(scale.tolist())


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


def _surface(document: Document, primitive: dict[str, Any]) -> Surface | None:
    """Triangles of a primitive; None for points and lines."""
    mode, attributes = primitive.get("mode", _TRIANGLES), primitive["attributes"]
    if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in attributes:
        return None
    points = read_accessor(document, attributes["POSITION"]).astype(np.float32)
    corners = read_accessor(document, primitive["indices"])[:, 0] if "indices" in primitive else np.arange(len(points))
    material, texture = _material(document, primitive.get("material"))
    joints, weights = _influences(document, attributes)
    return Surface(
        points=points,
        faces=_faces(corners.astype(np.int64), mode),
        material=material,
        normals=read_accessor(document, attributes["NORMAL"]).astype(np.float32) if "NORMAL" in attributes else None,
        st=_st(document, attributes, texture),
        colours=_colours(document, attributes),
        morphs=tuple(_offsets(document, target, len(points)) for target in primitive.get("targets", [])),
        joints=joints,
        weights=weights,
    )


def _faces(corners: Int[np.ndarray, "corner"], mode: int) -> Int[np.ndarray, "face 3"]:
    """Triangles of a list, strip or fan (§3.7.2.1); every second triangle of a strip is turned."""
    if mode == _TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    first = np.arange(max(len(corners) - 2, 0))
    if mode == _FAN:
        return np.stack([corners[first + 1], corners[first + 2], np.broadcast_to(corners[:1], first.shape)], axis=1)
    odd = first % 2
    return np.stack([corners[first], corners[first + 1 + odd], corners[first + 2 - odd]], axis=1)


def _offsets(document: Document, target: dict[str, int], count: int) -> Float[np.ndarray, "vertex 3"]:
    if "POSITION" not in target:
        return np.zeros((count, 3), np.float32)
    return read_accessor(document, target["POSITION"]).astype(np.float32)


def _colours(document: Document, attributes: dict[str, int]) -> Float[np.ndarray, "vertex 3"] | None:
    if "COLOR_0" not in attributes:
        return None
    return read_accessor(document, attributes["COLOR_0"])[:, :3].astype(np.float32)


def _influences(document: Document, attributes: dict[str, int]) -> tuple[Any, Any]:
    """Joints and weights of all sets, side by side; weights are made to sum to 1."""
    sets = [k for k in range(8) if f"JOINTS_{k}" in attributes and f"WEIGHTS_{k}" in attributes]
    if not sets:
        return None, None
    joints = np.concatenate([read_accessor(document, attributes[f"JOINTS_{k}"]) for k in sets], axis=1)
    weights = np.concatenate([read_accessor(document, attributes[f"WEIGHTS_{k}"]) for k in sets], axis=1)
    weights = weights.astype(np.float32)
    return joints.astype(np.int32), weights / weights.sum(1, keepdims=True).clip(1e-12)


def _st(document: Document, attributes: dict[str, int], texture: dict[str, Any]) -> Any:
    """Coordinates of the base colour's texture, turned from glTF's v down to v up (KHR_texture_transform applied)."""
    transform = texture.get("extensions", {}).get("KHR_texture_transform", {})
    name = f"TEXCOORD_{transform.get('texCoord', texture.get('texCoord', 0))}"
    if name not in attributes:
        return None
    uv = read_accessor(document, attributes[name]).astype(np.float64)
    cosine, sine = np.cos(transform.get("rotation", 0.0)), np.sin(transform.get("rotation", 0.0))
    uv = uv * transform.get("scale", (1, 1)) @ np.array([[cosine, -sine], [sine, cosine]]) + transform.get(
        "offset", (0, 0)
    )
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1).astype(np.float32)


def _material(document: Document, index: int | None) -> tuple[Material, dict[str, Any]]:
    """A material and the reference to its base colour's texture ({} without)."""
    if index is None:
        return Material(colour=(1.0, 1.0, 1.0), metallic=1.0, roughness=1.0), {}  # §3.7.2.1: the default material
    entry = document.items("materials")[index]
    surface = entry.get("pbrMetallicRoughness", {})
    red, green, blue, opacity = map(float, surface.get("baseColorFactor", (1, 1, 1, 1)))
    reference, mode = surface.get("baseColorTexture", {}), entry.get("alphaMode", "OPAQUE")
    texture = document.items("textures")[reference["index"]] if reference else {}
    sampler = document.items("samplers")[texture["sampler"]] if "sampler" in texture else {}
    material = Material(
        name=str(entry.get("name", "material")),
        colour=(red, green, blue),
        opacity=1.0 if mode == "OPAQUE" else opacity,
        metallic=float(surface.get("metallicFactor", 1.0)),
        roughness=float(surface.get("roughnessFactor", 1.0)),
        texture=texture.get("source"),
        wrap=(_WRAPS[sampler.get("wrapS", 10497)], _WRAPS[sampler.get("wrapT", 10497)]),
        cutoff=float(entry.get("alphaCutoff", 0.5)) if mode == "MASK" else None,
        blend=mode == "BLEND",
        double_sided=bool(entry.get("doubleSided", False)),
    )
    return material, reference


def _skin(document: Document, entry: dict[str, Any], place: dict[int, int]) -> Skin:
    joints = tuple(place[j] for j in entry["joints"])
    if "inverseBindMatrices" not in entry:
        return Skin(joints, np.tile(np.eye(4), (len(joints), 1, 1)))
    columns = read_accessor(document, entry["inverseBindMatrices"]).astype(np.float64)
    return Skin(joints, columns.reshape(-1, 4, 4).transpose(0, 2, 1))


def _tracks(document: Document, clip: dict[str, Any], place: dict[int, int]) -> tuple[Track, ...]:
    """The clip's channels on nodes of the scene, shifted to start at 0."""
    found = []
    for channel in clip["channels"]:
        target = channel["target"]
        if target.get("node") not in place or target["path"] not in _QUANTITIES:
            continue
        sampler = clip["samplers"][channel["sampler"]]
        interpolation = sampler.get("interpolation", "LINEAR")
        seconds = read_accessor(document, sampler["input"])[:, 0].astype(np.float64)
        values = read_accessor(document, sampler["output"]).astype(np.float64)
        if target["path"] == "weights":  # a scalar accessor, one after the other
            values = values.reshape(len(seconds) * (3 if interpolation == "CUBICSPLINE" else 1), -1)
        if target["path"] == "rotation":
            values = values[:, [3, 0, 1, 2]]
        found.append(Track(place[target["node"]], target["path"], seconds, values, interpolation))
    start = min((float(t.seconds[0]) for t in found), default=0.0)
    return tuple(Track(t.node, t.quantity, t.seconds - start, t.values, t.interpolation) for t in found)
