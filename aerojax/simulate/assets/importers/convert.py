"""Convert a user's model to a stage like those of the catalogue: nose +X, up +Z, metres, middle at the origin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from aerojax.core.errors import UserError
from aerojax.core.files import fingerprint
from aerojax.core.usd_files import save_stage
from aerojax.simulate.assets.importers.gltf import load_gltf
from aerojax.simulate.assets.importers.mesh_files import load_mesh_file
from aerojax.simulate.assets.importers.models import GLTF, MESHES, WAVEFRONT, ImportedModel, body_from_file, described
from aerojax.simulate.assets.importers.motion import at_speed, without_mirrors
from aerojax.simulate.assets.importers.obj import load_wavefront
from aerojax.simulate.assets.importers.scene import ImportedScene
from aerojax.simulate.assets.importers.size import length_by_class, middle, survey
from aerojax.simulate.assets.importers.textures import write_textures
from aerojax.simulate.assets.importers.usd import copy_source, open_source
from aerojax.simulate.assets.importers.write_usd import write_scene
from aerojax.simulate.usd.animated_mesh import MOST_TRIANGLES, load_animated_mesh
from aerojax.simulate.usd.authoring import row_matrix, write_stage
from aerojax.simulate.usd.opening import usd_refusals
from aerojax.simulate.usd.placements import MOST_COPIES

DIGEST = "aerojax:import"
"""Key of the stage's layer data under which the digest of what it was converted from lies."""
LONGEST_SECONDS = 3600.0
"""Of a clip at its speed: an hour of cubic splines is sampled 432,000 times, a channel."""


def convert_model(model: ImportedModel, path: Path) -> None:
    """Write the stage `path` and its PNGs, unless it is there and was made from the same file in the same way.

    The model hangs under one prim whose transform is the only thing that conversion adds to it, so that lengths inside
    stay the file's own.

    Raises:
        UserError: if the file cannot be read, lacks what the list asks for, or its size is not to be found.
    """
    if not model.file.is_file():
        raise UserError(
            "missing", f"model {model.name}: file {model.file} does not exist", "correct the list of models"
        )
    digest = fingerprint(model.file.read_bytes(), described(model).encode())
    if path.is_file() and _digest_of(path) == digest:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    if model.file.suffix.lower() in GLTF + WAVEFRONT + MESHES:
        _convert_scene(model, path, digest)
    else:
        with usd_refusals(str(model.file)):
            _convert_stage(model, path, digest)
    if stale := Sdf.Layer.Find(str(path)):
        stale.Reload(True)


def _digest_of(path: Path) -> str:
    layer = Sdf.Layer.OpenAsAnonymous(str(path), metadataOnly=True)
    return str(layer.customLayerData.get(DIGEST, ""))


def _convert_scene(model: ImportedModel, path: Path, digest: str) -> None:
    scene = at_speed(without_mirrors(_load(model)), model.speed)
    _check_bounds(scene, model)
    textures = write_textures(scene, path, str(model.file))

    def fill(stage: Usd.Stage, root: Sdf.Path) -> None:
        write_scene(stage, root.AppendChild("model"), scene, textures)
        _place(stage, root.AppendChild("model"), model, model.up)
        _note_origin(stage, model, digest)

    write_stage(path, scene.seconds, fill)


def _check_bounds(scene: ImportedScene, model: ImportedModel) -> None:
    """Refuse what would write more than a stage can hold: small files can name one mesh many times."""
    surfaces = [surface for node in scene.nodes for surface in node.surfaces]
    faces = sum(len(surface.faces) for surface in surfaces)
    for found, most, what in (
        (len(surfaces), MOST_COPIES, "meshes and copies"),
        (faces, MOST_TRIANGLES, "triangles"),
        (scene.seconds, LONGEST_SECONDS, "seconds of animation"),
    ):
        if found > most:
            raise UserError("out-of-range", f"{model.file}: holds {found:g} {what}, more than {most:g}", "simplify it")


def _load(model: ImportedModel) -> ImportedScene:
    if model.file.suffix.lower() in GLTF:
        return load_gltf(model.file, model.animation)
    if model.animation not in (None, "first"):
        kind = model.file.suffix[1:].upper()
        raise UserError(
            "invalid", f"{model.file}: animation is {model.animation!r}, but {kind} files hold no animation", "use none"
        )
    return load_wavefront(model.file) if model.file.suffix.lower() in WAVEFRONT else load_mesh_file(model.file)


def _convert_stage(model: ImportedModel, path: Path, digest: str) -> None:
    source = open_source(model.file, model.animation, model.speed)
    up = model.up or f"+{source.up}"
    if up[1] == model.forward[1]:
        raise UserError(
            "invalid",
            f"model {model.name}: forward is {model.forward}, but the stage's up axis is {up}",
            "correct either",
        )

    def fill(stage: Usd.Stage, root: Sdf.Path) -> None:
        copy_source(stage, root.AppendChild("model"), source, path)
        _place(stage, root.AppendChild("model"), model, up)
        _note_origin(stage, model, digest)

    write_stage(path, source.seconds, fill)


def _place(stage: Usd.Stage, prim: Sdf.Path, model: ImportedModel, up: str) -> None:
    """Turn the model into the body frame, then scale and centre it by what it measures there."""
    turn = np.eye(4)
    turn[:3, :3] = body_from_file(model.forward, up)
    operation = UsdGeom.Xformable(stage.GetPrimAtPath(prim)).AddTransformOp()
    operation.Set(row_matrix(turn))
    save_stage(stage)
    found = survey(load_animated_mesh(Path(stage.GetRootLayer().realPath), called=str(model.file)))
    automatic = model.scale == "auto"
    factor = 1.0 / length_by_class(found, model.label, str(model.file)) if automatic else float(model.scale)
    turn[:3] *= factor
    turn[:3, 3] = -factor * middle(found)
    operation.Set(row_matrix(turn))


def _note_origin(stage: Usd.Stage, model: ImportedModel, digest: str) -> None:
    """Note in the layer what it was made from."""
    stage.GetRootLayer().customLayerData = {DIGEST: digest, "source": model.source, "licence": model.licence}
