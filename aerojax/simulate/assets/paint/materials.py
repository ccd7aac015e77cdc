"""The texture of an asset, baked and written beside its stage, and the materials that bind it."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from aerojax.simulate.assets.mesh.parts import Part, corner_normals
from aerojax.simulate.assets.mesh.shapes import merge
from aerojax.simulate.assets.paint import atlas as textures
from aerojax.simulate.assets.paint import patterns
from aerojax.simulate.assets.paint.texture_file import write_texture

GLASS = ("glass", "canopy", "windscreen", "windows")
"""Names of parts that are glossy and have no pattern; their colour is the palette's, as any part's, because glass of a
colour of its own would tell birds from what people fly."""
GLASS_ROUGHNESS = 0.08


@dataclass(frozen=True)
class PartTexture:
    """A part's texture coordinates and its faces' mean colours (linear)."""

    st: Float[np.ndarray, "face 3 2"]
    linear: Float[np.ndarray, "face 3"]


@dataclass(frozen=True)
class BakedTexture:
    """The texture of an asset: its parts' places in it, in their order, its file's name and the paint's roughness."""

    parts: tuple[PartTexture, ...]
    file: str
    roughness: float


def bake_texture(path: Path, parts: tuple[Part, ...], seed: int) -> BakedTexture:
    """Bake the parts' colours into `<path's stem>.png` beside the stage `path`.

    Args:
        path: of the stage that will bind the texture.
        parts: in the rest pose, body frame, metres.
        seed: of palette and patterns; all that decides the colours, beside the shape.

    Raises:
        UserError: if the texture cannot be written.
    """
    paint = patterns.draw_paint(seed)
    whole = merge(*(part.mesh for part in parts))
    atlas = textures.lay_out(whole)
    texels = textures.texels_of(atlas)
    first = np.cumsum([0] + [len(part.mesh.faces) for part in parts])
    corners = np.concatenate([corner_values(part, parts) for part in parts])
    srgb = np.empty((len(texels.face), 3))
    for number, part in enumerate(parts):
        chosen = np.flatnonzero((texels.face >= first[number]) & (texels.face < first[number + 1]))
        surface = surface_at(textures.interpolate(texels, corners, chosen))
        srgb[chosen] = patterns.colours(paint, part.role, surface, plain=part.name in GLASS)
    image, linear = textures.compose(atlas, texels, srgb)
    target = path.with_suffix(".png")
    write_texture(target, image, compression=6)
    st = atlas.st()
    pieces = [slice(a, b) for a, b in pairwise(first.tolist())]
    return BakedTexture(tuple(PartTexture(st[p], linear[p]) for p in pieces), target.name, paint.palette.roughness)


def corner_values(part: Part, parts: tuple[Part, ...]) -> Float[np.ndarray, "face 3 8"]:
    """What a `Surface` is made of at the corners of a part of `parts`: position, normal, along, across."""
    points = part.mesh.points
    if part.spin is None:
        fixed = np.concatenate([p.mesh.points for p in parts if p.spin is None])
        middle, half = (fixed.min(0) + fixed.max(0)) / 2, np.ptp(fixed, axis=0) / 2
        along, across = (points[:, 0] - middle[0]) / half[0], np.abs(points[:, 1]) / np.abs(fixed[:, 1]).max()
    else:
        radius = np.hypot(points[:, 0], points[:, 1])
        along, across = points[:, 0] / radius.max(), radius / radius.max()
    values = np.concatenate([points, along[:, None], across[:, None]], axis=1)[part.mesh.faces]
    return np.concatenate([values[..., :3], corner_normals(part.mesh).reshape(-1, 3, 3), values[..., 3:]], axis=2)


def surface_at(values: Float[np.ndarray, "sample 8"]) -> patterns.Surface:
    """Points of an asset from interpolated `corner_values`."""
    normal = values[:, 3:6]
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True).clip(1e-9)
    return patterns.Surface(values[:, :3], normal, values[:, 6], values[:, 7].clip(0.0, 1.0))


@dataclass
class Materials:
    """Materials under one scope of a stage, made when a part first needs them."""

    stage: Usd.Stage
    scope: Sdf.Path
    texture: BakedTexture
    _made: dict[str, UsdShade.Material] = field(default_factory=dict)

    def bind(self, mesh: UsdGeom.Mesh, part: Part, texture: PartTexture) -> None:
        """Give a mesh its texture coordinates (`primvars:st`, one a corner) and its material."""
        variable = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        )
        variable.Set(Vt.Vec2fArray.FromNumpy(texture.st.reshape(-1, 2).astype(np.float32)))
        if part.opacity < 1.0:
            mesh.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.constant).Set([part.opacity])
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(self._material(part))

    def _material(self, part: Part) -> UsdShade.Material:
        glass = part.name in GLASS
        name = "glass" if glass else "paint"
        if part.opacity < 1.0:
            name += f"_{round(100 * part.opacity)}"
        if name not in self._made:
            roughness = GLASS_ROUGHNESS if glass else self.texture.roughness
            self._made[name] = self._define(name, roughness, part.opacity)
        return self._made[name]

    def _define(self, name: str, roughness: float, opacity: float) -> UsdShade.Material:
        """A UsdPreviewSurface whose diffuse colour is the texture at `st`."""
        UsdGeom.Scope.Define(self.stage, self.scope)
        path, types = self.scope.AppendChild(name), Sdf.ValueTypeNames
        material = UsdShade.Material.Define(self.stage, path)
        reader = UsdShade.Shader.Define(self.stage, path.AppendChild("coordinates"))
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", types.String).Set("st")
        texture = UsdShade.Shader.Define(self.stage, path.AppendChild("texture"))
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", types.Asset).Set(Sdf.AssetPath(f"./{self.texture.file}"))
        texture.CreateInput("sourceColorSpace", types.Token).Set("sRGB")
        texture.CreateInput("wrapS", types.Token).Set("clamp")
        texture.CreateInput("wrapT", types.Token).Set("clamp")
        texture.CreateInput("fallback", types.Float4).Set(Gf.Vec4f(0.5, 0.5, 0.5, 1.0))
        texture.CreateInput("st", types.Float2).ConnectToSource(reader.CreateOutput("result", types.Float2))
        surface = UsdShade.Shader.Define(self.stage, path.AppendChild("surface"))
        surface.CreateIdAttr("UsdPreviewSurface")
        diffuse = surface.CreateInput("diffuseColor", types.Color3f)
        diffuse.ConnectToSource(texture.CreateOutput("rgb", types.Float3))
        surface.CreateInput("roughness", types.Float).Set(roughness)
        surface.CreateInput("metallic", types.Float).Set(0.0)
        surface.CreateInput("opacity", types.Float).Set(opacity)
        material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", types.Token))
        return material
