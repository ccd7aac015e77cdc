"""Primitives of a glTF document as surfaces: triangles, attributes, morph targets and materials."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from aerojax.simulate.assets.importers.gltf_document import Document, read_accessor
from aerojax.simulate.assets.importers.scene import Material, Surface

_LINES, _TRIANGLES, _STRIP, _FAN = range(4), 4, 5, 6
_WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_DRACO = "KHR_draco_mesh_compression"


def mesh_surfaces(document: Document, index: Any, where: str) -> tuple[Surface, ...]:
    """Triangles of a mesh's primitives; points, lines and primitives without vertices are left out.

    Raises:
        UserError: an attribute is not as the format says; the message names the field.
    """
    mesh = document.entry("meshes", index, where)
    found = [
        _surface(document, primitive, f"meshes[{index}].primitives[{k}]")
        for k, primitive in enumerate(mesh.get("primitives", []))
    ]
    return tuple(surface for surface in found if surface is not None)


def _surface(document: Document, primitive: dict[str, Any], where: str) -> Surface | None:
    mode, attributes = primitive.get("mode", _TRIANGLES), primitive.get("attributes", {})
    if mode in _LINES or "POSITION" not in attributes:
        return None
    if mode not in (_TRIANGLES, _STRIP, _FAN):
        raise document.error(f"{where}.mode is {mode!r}", "use triangles, strips or fans")
    if _DRACO in primitive.get("extensions", {}):
        raise document.error(f"{where} needs {_DRACO}, which is not read", "export without compression")
    points = _attribute(document, attributes, "POSITION", where, ("VEC3",))
    assert points is not None
    count = len(points)
    corners = np.arange(count)
    if "indices" in primitive:
        corners = read_accessor(document, primitive["indices"], f"{where}.indices", ("SCALAR",))[:, 0].astype(np.int64)
    if len(corners) and not 0 <= corners.min() <= corners.max() < count:
        wrong = corners[(corners < 0) | (corners >= count)][0]
        raise document.error(f"{where}.indices names vertex {wrong} of {count}")
    faces = _faces(corners, mode)
    if not len(faces):
        return None
    material, texture = _material(document, primitive.get("material"), f"{where}.material")
    joints, weights = _influences(document, attributes, where, count)
    colours = _attribute(document, attributes, "COLOR_0", where, ("VEC3", "VEC4"), count)
    return Surface(
        points=points,
        faces=faces,
        material=material,
        normals=_attribute(document, attributes, "NORMAL", where, ("VEC3",), count, finite=False),
        st=_st(document, attributes, texture, where, count),
        colours=None if colours is None else colours[:, :3],
        morphs=tuple(_offsets(document, t, f"{where}.targets", count) for t in primitive.get("targets", [])),
        joints=joints,
        weights=weights,
    )


def _attribute(
    document: Document,
    attributes: dict[str, Any],
    name: str,
    where: str,
    types: tuple[str, ...],
    count: int | None = None,
    *,
    finite: bool = True,
) -> Float[np.ndarray, "vertex component"] | None:
    """Rows of an attribute, one a vertex; None without it. What need not be finite is 0 where it is not."""
    if name not in attributes:
        return None
    field = f"{where}.attributes.{name}"
    rows = read_accessor(document, attributes[name], field, types, finite=finite).astype(np.float32)
    if count is not None and len(rows) != count:
        raise document.error(f"{field} has {len(rows)} elements, POSITION {count}")
    return rows if finite else np.where(np.isfinite(rows), rows, np.float32(0))


def _faces(corners: Int[np.ndarray, "corner"], mode: int) -> Int[np.ndarray, "face 3"]:
    """Triangles of a list, strip or fan (§3.7.2.1); every second triangle of a strip is turned."""
    if mode == _TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    first = np.arange(max(len(corners) - 2, 0))
    if mode == _FAN:
        return np.stack([corners[first + 1], corners[first + 2], np.broadcast_to(corners[:1], first.shape)], axis=1)
    odd = first % 2
    return np.stack([corners[first], corners[first + 1 + odd], corners[first + 2 - odd]], axis=1)


def _offsets(document: Document, target: dict[str, Any], where: str, count: int) -> Float[np.ndarray, "vertex 3"]:
    found = _attribute(document, target, "POSITION", where, ("VEC3",), count)
    return np.zeros((count, 3), np.float32) if found is None else found


def _influences(document: Document, attributes: dict[str, Any], where: str, count: int) -> tuple[Any, Any]:
    """Joints and weights of all sets, side by side; weights are made to sum to 1."""
    sets = [k for k in range(8) if f"JOINTS_{k}" in attributes and f"WEIGHTS_{k}" in attributes]
    if not sets:
        return None, None
    kinds = ("JOINTS", "WEIGHTS")
    columns = [[_attribute(document, attributes, f"{n}_{k}", where, ("VEC4",), count) for k in sets] for n in kinds]
    joints, weights = (np.concatenate([c for c in column if c is not None], axis=1) for column in columns)
    weights = weights.clip(0.0)
    return joints.astype(np.int32), weights / weights.sum(1, keepdims=True).clip(1e-12)


def _st(document: Document, attributes: dict[str, Any], texture: dict[str, Any], where: str, count: int) -> Any:
    """Coordinates of the base colour's texture, turned from glTF's v down to v up (KHR_texture_transform applied)."""
    transform = texture.get("extensions", {}).get("KHR_texture_transform", {})
    name = f"TEXCOORD_{transform.get('texCoord', texture.get('texCoord', 0))}"
    uv = _attribute(document, attributes, name, where, ("VEC2",), count)
    if uv is None:
        return None
    field = "KHR_texture_transform"
    angle = document.number(transform, "rotation", 0.0, field)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moved = uv.astype(np.float64) * document.vector(transform, "scale", (1.0, 1.0), field) @ turn
    moved = moved + document.vector(transform, "offset", (0.0, 0.0), field)
    return np.stack([moved[:, 0], 1.0 - moved[:, 1]], axis=1).astype(np.float32)


def _material(document: Document, index: Any, where: str) -> tuple[Material, dict[str, Any]]:
    """A material and the reference to its base colour's texture ({} without)."""
    if index is None:
        return Material(colour=(1.0, 1.0, 1.0), metallic=1.0, roughness=1.0), {}  # §3.7.2.1: the default material
    entry, name = document.entry("materials", index, where), f"materials[{index}]"
    surface = _metallic_roughness(document, entry, name)
    red, green, blue, opacity = document.vector(surface, "baseColorFactor", (1.0, 1.0, 1.0, 1.0), name)
    reference, mode = surface.get("baseColorTexture", {}), entry.get("alphaMode", "OPAQUE")
    texture = document.entry("textures", reference.get("index"), f"{name}.baseColorTexture") if reference else {}
    sampler = document.entry("samplers", texture["sampler"], "textures[…].sampler") if "sampler" in texture else {}
    material = Material(
        name=str(entry.get("name", "material")),
        colour=(red, green, blue),
        opacity=1.0 if mode == "OPAQUE" else opacity,
        metallic=document.number(surface, "metallicFactor", 1.0, name),
        roughness=document.number(surface, "roughnessFactor", 1.0, name),
        texture=_image(document, texture) if reference else None,
        wrap=(_WRAPS[sampler.get("wrapS", 10497)], _WRAPS[sampler.get("wrapT", 10497)]),
        cutoff=document.number(entry, "alphaCutoff", 0.5, name) if mode == "MASK" else None,
        blend=mode == "BLEND",
        double_sided=bool(entry.get("doubleSided", False)),
    )
    return material, reference


def _metallic_roughness(document: Document, entry: dict[str, Any], where: str) -> dict[str, Any]:
    """The base colour's fields; of a specular-glossiness material its diffuse ones, which mean the same here."""
    glossy = entry.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
    if glossy is None or "pbrMetallicRoughness" in entry:
        return entry.get("pbrMetallicRoughness", {})
    fields = {"baseColorFactor": "diffuseFactor", "baseColorTexture": "diffuseTexture"}
    roughness = 1.0 - document.number(glossy, "glossinessFactor", 1.0, where)
    found = {ours: glossy[theirs] for ours, theirs in fields.items() if theirs in glossy}
    return {**found, "metallicFactor": 0.0, "roughnessFactor": roughness}


def _image(document: Document, texture: dict[str, Any]) -> int:
    """Number of a texture's image: its plain one, else the WebP one."""
    extensions = texture.get("extensions", {})
    source = texture.get("source", extensions.get("EXT_texture_webp", {}).get("source"))
    if source is None:
        raise document.error(f"a texture names no image that is read ({', '.join(extensions)})", "use PNG or JPEG")
    document.entry("images", source, "textures[…].source")
    return source
