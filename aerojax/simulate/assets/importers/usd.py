"""A user's own USD stage, flattened into a converted one: time in our time codes, textures as PNG beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pxr import Ar, Sdf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.textures import decode_image
from aerojax.simulate.assets.paint.texture_file import write_texture
from aerojax.simulate.usd.authoring import TIME_CODES_PER_SECOND
from aerojax.simulate.usd.opening import foreign_stage, time_span


@dataclass(frozen=True)
class SourceStage:
    """What is copied: the flattened layer, its up axis ("Y" or "Z") and its length at the speed that was asked for."""

    path: Path
    layer: Sdf.Layer
    up: str
    seconds: float
    still: bool


def open_source(path: Path, animation: int | str | None, speed: float) -> SourceStage:
    """Compose and flatten a USD file; samples lie on `TIME_CODES_PER_SECOND`, starting at 0.

    Raises:
        UserError: if the file is not readable, or a clip other than the stage's one timeline is asked for.
    """
    if animation not in (None, 0, "first"):
        raise UserError(
            "invalid", f"{path}: animation is {animation!r}, but a USD stage has one timeline", "use 0 or none"
        )
    with foreign_stage(path) as source:
        rate, (start, end) = source.GetTimeCodesPerSecond(), time_span(source, str(path))
        seconds = (end - start) / rate / speed
        stage = Usd.Stage.CreateInMemory()
        stage.SetTimeCodesPerSecond(TIME_CODES_PER_SECOND)
        stage.GetRootLayer().subLayerPaths.append(source.GetRootLayer().identifier)
        # USD itself scales a sublayer's time by the ratio of the two rates; the offset acts after that.
        offset = Sdf.LayerOffset(-start * TIME_CODES_PER_SECOND / rate / speed, 1.0 / speed)
        stage.GetRootLayer().subLayerOffsets[0] = offset
        still = animation is None or seconds == 0.0
        up = str(UsdGeom.GetStageUpAxis(source))
        return SourceStage(path, stage.Flatten(False), up, 0.0 if still else seconds, still)


def copy_source(stage: Usd.Stage, model: Sdf.Path, source: SourceStage, target: Path) -> None:
    """Copy everything of the source below the prim `model`, without lights and cameras.

    Args:
        stage: to write to.
        model: path of a new prim.
        source: flattened.
        target: the stage's final path, which gives textures their names.

    Raises:
        UserError: if a texture is missing or not readable.
    """
    UsdGeom.Xform.Define(stage, model)
    for prim in source.layer.rootPrims:  # classes and overs too: prototypes of instancers are often such
        Sdf.CopySpec(source.layer, prim.path, stage.GetRootLayer(), model.AppendChild(prim.name))
    _redirect(stage, model)
    for prim in [p for p in Usd.PrimRange(stage.GetPrimAtPath(model)) if _is_light_or_camera(p)]:
        stage.RemovePrim(prim.GetPath())
    for prim in Usd.PrimRange(stage.GetPrimAtPath(model)):
        prim.ClearMetadata("kind")
        if source.still:
            _keep_first_sample(prim)
        if prim.IsA(UsdGeom.Boundable):
            _author_extent(UsdGeom.Boundable(prim))
    _copy_textures(stage, model, source, target)


def _is_light_or_camera(prim: Usd.Prim) -> bool:
    return prim.IsA(UsdGeom.Camera) or prim.HasAPI(UsdLux.LightAPI)


def _redirect(stage: Usd.Stage, model: Sdf.Path) -> None:
    """Point relationships and connections between root prims to their copies (within one, copying does it)."""
    for prim in Usd.PrimRange(stage.GetPrimAtPath(model)):
        for relation in prim.GetRelationships():
            targets = relation.GetTargets()
            if any(not t.HasPrefix(model) for t in targets):
                relation.SetTargets([_moved(t, model) for t in targets])
        for attribute in prim.GetAttributes():
            sources = attribute.GetConnections()
            if any(not s.HasPrefix(model) for s in sources):
                attribute.SetConnections([_moved(s, model) for s in sources])


def _moved(path: Sdf.Path, model: Sdf.Path) -> Sdf.Path:
    return path if path.HasPrefix(model) else path.ReplacePrefix(Sdf.Path.absoluteRootPath, model)


def _keep_first_sample(prim: Usd.Prim) -> None:
    """Keep each attribute's value at the start of the timeline only."""
    for attribute in prim.GetAttributes():
        if attribute.GetNumTimeSamples():
            value = attribute.Get(0.0)
            attribute.Clear()
            attribute.Set(value)


def _author_extent(prim: UsdGeom.Boundable) -> None:
    """Author the extent that a prim lacks, where it has one."""
    kinds = (UsdSkel.Root, UsdSkel.Skeleton)
    if prim.GetExtentAttr().HasAuthoredValue() or any(prim.GetPrim().IsA(kind) for kind in kinds):
        return
    extent = UsdGeom.Boundable.ComputeExtentFromPlugins(prim, Usd.TimeCode.EarliestTime())
    if extent:
        prim.CreateExtentAttr(extent)


def _copy_textures(stage: Usd.Stage, model: Sdf.Path, source: SourceStage, target: Path) -> None:
    """Write every texture as PNG beside the stage and name it relative to it."""
    files: dict[str, list[Usd.Attribute]] = {}
    for prim in Usd.PrimRange(stage.GetPrimAtPath(model)):
        shader = UsdShade.Shader(prim)
        file = shader.GetInput("file") if shader and shader.GetIdAttr().Get() == "UsdUVTexture" else None
        if file and file.GetAttr().Get():
            files.setdefault(file.GetAttr().Get().path, []).append(file.GetAttr())
    for number, (path, attributes) in enumerate(files.items()):
        name = f"{target.stem}.png" if len(files) == 1 else f"{target.stem}.{number}.png"
        write_texture(target.with_name(name), decode_image(_bytes(path, source.path), f"{source.path}: {path}"))
        for attribute in attributes:
            attribute.Set(Sdf.AssetPath(f"./{name}"))


def _bytes(path: str, source: Path) -> bytes:
    resolved = Ar.GetResolver().Resolve(path)
    asset = Ar.GetResolver().OpenAsset(resolved) if resolved else None
    if asset is None:
        raise UserError("missing", f"{source}: the texture {path} is not there", "put it where the material says")
    return bytes(asset.GetBuffer())
