"""Materials of an imported model as UsdPreviewSurface networks."""

from __future__ import annotations

import re

from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from aerojax.simulate.assets.importers.scene import Material, Surface
from aerojax.simulate.assets.importers.textures import uses_alpha


def preview_material(stage: Usd.Stage, scope: Sdf.Path, surface: Surface, texture: str | None) -> UsdShade.Material:
    """The surface's material under `scope`, made when it is first needed; those that differ in name alone are one.

    Args:
        stage: to write to.
        scope: path that holds materials.
        surface: that has it; its vertices' colours count where it has no texture.
        texture: the texture's file name beside the stage; None without.
    """
    given, coloured = surface.material, surface.colours is not None and texture is None
    path = scope.AppendChild(_material_name(given, texture, coloured))
    material = UsdShade.Material.Get(stage, path)
    if material:
        return material
    UsdGeom.Scope.Define(stage, scope)
    material, types = UsdShade.Material.Define(stage, path), Sdf.ValueTypeNames
    shader = UsdShade.Shader.Define(stage, path.AppendChild("surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("metallic", types.Float).Set(given.metallic)
    shader.CreateInput("roughness", types.Float).Set(given.roughness)
    diffuse, opacity = shader.CreateInput("diffuseColor", types.Color3f), shader.CreateInput("opacity", types.Float)
    opacity.Set(given.opacity)
    if given.cutoff is not None:
        shader.CreateInput("opacityThreshold", types.Float).Set(given.cutoff)
    if texture is not None:
        sampler = _sampler(stage, path, texture, given.wrap)
        diffuse.ConnectToSource(sampler.CreateOutput("rgb", types.Float3))
        if uses_alpha(given):
            sampler.CreateInput("scale", types.Float4).Set(Gf.Vec4f(1.0, 1.0, 1.0, given.opacity))
            opacity.ConnectToSource(sampler.CreateOutput("a", types.Float))
    elif coloured:
        reader = _reader(stage, path, "colours", "UsdPrimvarReader_float3", "displayColor")
        diffuse.ConnectToSource(reader.CreateOutput("result", types.Float3))
    else:
        diffuse.Set(Gf.Vec3f(*given.colour))
    material.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", types.Token))
    return material


def _material_name(material: Material, texture: str | None, coloured: bool) -> str:
    """A name that says what the material is, the same for equal ones."""
    base = texture.rpartition(".")[0] if texture else "vertex_colours" if coloured else "plain"
    words = () if texture or coloured else material.colour
    numbers = (*words, material.metallic, material.roughness, material.opacity, material.cutoff or 0.0)
    wrap = "_".join(material.wrap) if texture else ""
    blend = "_blend" if material.blend else ""
    return re.sub(r"\W", "_", f"m_{base}_{'_'.join(f'{v:.4g}' for v in numbers)}_{wrap}{blend}").rstrip("_")


def _sampler(stage: Usd.Stage, path: Sdf.Path, texture: str, wrap: tuple[str, str]) -> UsdShade.Shader:
    types = Sdf.ValueTypeNames
    reader = _reader(stage, path, "coordinates", "UsdPrimvarReader_float2", "st")
    sampler = UsdShade.Shader.Define(stage, path.AppendChild("texture"))
    sampler.CreateIdAttr("UsdUVTexture")
    sampler.CreateInput("file", types.Asset).Set(Sdf.AssetPath(f"./{texture}"))
    sampler.CreateInput("sourceColorSpace", types.Token).Set("sRGB")
    sampler.CreateInput("wrapS", types.Token).Set(wrap[0])
    sampler.CreateInput("wrapT", types.Token).Set(wrap[1])
    sampler.CreateInput("fallback", types.Float4).Set(Gf.Vec4f(0.5, 0.5, 0.5, 1.0))
    sampler.CreateInput("st", types.Float2).ConnectToSource(reader.CreateOutput("result", types.Float2))
    return sampler


def _reader(stage: Usd.Stage, path: Sdf.Path, name: str, kind: str, variable: str) -> UsdShade.Shader:
    reader = UsdShade.Shader.Define(stage, path.AppendChild(name))
    reader.CreateIdAttr(kind)
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(variable)
    return reader
