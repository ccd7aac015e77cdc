"""What the faces of USD meshes look like: UsdPreviewSurface colours and textures, `displayColor` where there is none.

Read are `diffuseColor` as a constant or from a UsdUVTexture (its file relative to the stage or inside a usdz) over any
float2 primvar, bound to a mesh, to its ancestors or to GeomSubsets. Texture scale, bias and transforms are not read.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from jaxtyping import Float, Int, Int32, UInt8
from pxr import Ar, Usd, UsdGeom, UsdShade

from aerojax.core.colour import srgb_from_linear
from aerojax.core.errors import UserError
from aerojax.simulate.usd.pictures import decode_picture

EARLIEST = Usd.TimeCode.EarliestTime()
GREY = 0.5
"""sRGB of a mesh that says nothing about its colour."""


@dataclass(frozen=True)
class FaceAppearance:
    """What one mesh's triangles look like.

    albedo: sRGB, 0..1; white where a texture gives the colour.
    uv: texture coordinates of the corners, v upwards; zero without a texture.
    texture: index into the stage's textures, -1 without one.
    """

    albedo: Float[np.ndarray, "face 3"]
    uv: Float[np.ndarray, "face 3 2"]
    texture: Int32[np.ndarray, "face"]


@dataclass
class TextureCache:
    """Pictures of a stage, each read once, in the order of first use (sRGB bytes, top row first)."""

    pictures: list[UInt8[np.ndarray, "height width 3"]] = field(default_factory=list)
    _index: dict[str, int] = field(default_factory=dict)

    def index_of(self, path: str) -> int:
        """Index of the picture at a resolved asset path, read when it is new.

        Raises:
            UserError: the file cannot be read as a PNG or JPEG picture.
        """
        if path not in self._index:
            self._index[path] = len(self.pictures)
            self.pictures.append(_read_picture(path))
        return self._index[path]


def _read_picture(path: str) -> UInt8[np.ndarray, "height width 3"]:
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path)) if path else None
    data = bytes(asset.GetBuffer()) if asset is not None else b""
    picture = decode_picture(data, path or "a texture", cv2.IMREAD_COLOR)
    return np.ascontiguousarray(picture[:, :, ::-1])


def face_appearance(
    mesh: UsdGeom.Gprim,
    triangles: Int[np.ndarray, "face 3"],
    corners: Int[np.ndarray, "face 3"],
    polygon: Int[np.ndarray, "face"],
    textures: TextureCache,
) -> FaceAppearance:
    """What a mesh's triangles look like, from its material bindings.

    Args:
        mesh: of the stage.
        triangles: vertex indices.
        corners: positions of the same corners in the mesh's list of face vertices.
        polygon: the mesh's face that each triangle comes from.
        textures: collects pictures.

    Raises:
        UserError: a texture or its coordinates are missing; the message names the mesh.
    """
    count = len(triangles)
    albedo = display_colour(mesh, triangles, polygon)
    uv, texture = np.zeros((count, 3, 2)), np.full(count, -1, np.int32)
    for prim, chosen in _bindings(mesh, polygon):
        surface = _preview_surface(prim)
        shader = None if surface is None else surface.GetInput("diffuseColor")
        if not shader:
            continue
        picture = _connected(shader, "UsdUVTexture")
        if picture is None:
            value = _constant(shader)
            if value is not None:
                texture[chosen] = -1
                albedo[chosen] = srgb_from_linear(np.asarray(value, np.float64)).clip(0.0, 1.0)
            continue
        texture[chosen] = textures.index_of(_texture_path(picture, mesh))
        albedo[chosen] = 1.0
        uv[chosen] = _coordinates(mesh, picture, triangles, corners)[chosen]
    return FaceAppearance(albedo, uv, texture)


def _bindings(mesh: UsdGeom.Gprim, polygon: np.ndarray) -> list[tuple[Usd.Prim, np.ndarray]]:
    """The mesh with all its triangles, then each material subset with its own."""
    everything = np.ones(len(polygon), bool)
    found = [(mesh.GetPrim(), everything)]
    for subset in UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets():
        indices = np.asarray(subset.GetIndicesAttr().Get(EARLIEST), np.int64)
        found.append((subset.GetPrim(), np.isin(polygon, indices)))
    return found


def _preview_surface(prim: Usd.Prim) -> UsdShade.Shader | None:
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    if not material:
        return None
    shader, _, _ = material.ComputeSurfaceSource()
    return shader if shader and shader.GetIdAttr().Get() == "UsdPreviewSurface" else None


def _connected(value: UsdShade.Input, kind: str) -> UsdShade.Shader | None:
    """The shader of one kind that gives an input's value, through any node graphs."""
    for attribute in value.GetValueProducingAttributes():
        shader = UsdShade.Shader(attribute.GetPrim())
        if shader and shader.GetIdAttr().Get() == kind:
            return shader
    return None


def _constant(value: UsdShade.Input) -> tuple[float, float, float] | None:
    for attribute in value.GetValueProducingAttributes():
        found = attribute.Get(EARLIEST)
        if found is not None and len(found) == 3:
            return (float(found[0]), float(found[1]), float(found[2]))
    return None


def _texture_path(shader: UsdShade.Shader, mesh: UsdGeom.Gprim) -> str:
    for attribute in shader.GetInput("file").GetValueProducingAttributes() if shader.GetInput("file") else ():
        asset = attribute.Get(EARLIEST)
        if asset is not None and asset.resolvedPath:
            return str(asset.resolvedPath)
        if asset is not None:
            raise UserError(
                "missing", f"{mesh.GetPath()}: its texture {asset.path!r} is not there", "put it beside the stage"
            )
    raise UserError("missing", f"{mesh.GetPath()}: its texture {shader.GetPath()} names no file", "set inputs:file")


def _coordinates(
    mesh: UsdGeom.Gprim, picture: UsdShade.Shader, triangles: np.ndarray, corners: np.ndarray
) -> Float[np.ndarray, "face 3 2"]:
    """Texture coordinates at the triangles' corners, whatever the primvar's interpolation."""
    name = _primvar_name(picture)
    variable = UsdGeom.PrimvarsAPI(mesh).FindPrimvarWithInheritance(name)
    values = variable.ComputeFlattened(EARLIEST) if variable else None
    if not values:
        raise UserError(
            "invalid", f"{mesh.GetPath()}: its texture needs the primvar {name!r}", "author texture coordinates"
        )
    flat, kind = np.asarray(values, np.float64), variable.GetInterpolation()
    if kind == UsdGeom.Tokens.faceVarying:
        return _picked(flat, corners, mesh, name)
    if kind in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying):
        return _picked(flat, triangles, mesh, name)
    return np.broadcast_to(flat[0], (*triangles.shape, 2)).copy()


def _primvar_name(picture: UsdShade.Shader) -> str:
    source = picture.GetInput("st")
    reader = _connected(source, "UsdPrimvarReader_float2") if source else None
    name = reader.GetInput("varname") if reader is not None else None
    for attribute in name.GetValueProducingAttributes() if name else ():
        value = attribute.Get(EARLIEST)
        if value:
            return str(value)
    return "st"


def display_colour(
    mesh: UsdGeom.Gprim, triangles: Int[np.ndarray, "face 3"], polygon: Int[np.ndarray, "face"]
) -> Float[np.ndarray, "face 3"]:
    """One sRGB colour a triangle from `displayColor`, whatever its interpolation; grey where it is absent."""
    variable = UsdGeom.PrimvarsAPI(mesh).FindPrimvarWithInheritance("displayColor")
    values = variable.ComputeFlattened(EARLIEST) if variable else None
    if not values:
        return np.full((len(triangles), 3), GREY)
    linear, kind = np.asarray(values, np.float64), variable.GetInterpolation()
    if kind == UsdGeom.Tokens.constant or not mesh.GetPrim().IsA(UsdGeom.Mesh):
        linear = np.broadcast_to(linear[0], (len(triangles), 3))
    elif kind == UsdGeom.Tokens.uniform:
        linear = _picked(linear, polygon, mesh, "displayColor")
    elif kind in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying):
        linear = _picked(linear, triangles, mesh, "displayColor").mean(axis=1)
    else:
        counts = np.asarray(UsdGeom.Mesh(mesh).GetFaceVertexCountsAttr().Get(EARLIEST))
        _picked(linear, np.array([counts.sum() - 1]), mesh, "displayColor")
        linear = np.add.reduceat(linear[: counts.sum()], (np.cumsum(counts) - counts).clip(0, counts.sum() - 1))
        linear = linear[polygon] / counts[polygon, None]
    return srgb_from_linear(linear.clip(0.0)).clip(0.0, 1.0)


def _picked(values: np.ndarray, rows: np.ndarray, mesh: UsdGeom.Gprim, name: str) -> np.ndarray:
    """Values of a primvar at rows that it must have."""
    if rows.size and rows.max() >= len(values):
        raise UserError(
            "invalid",
            f"{mesh.GetPath()}: primvar {name} has {len(values)} values, fewer than its interpolation needs",
            "export it again",
        )
    return values[rows]
