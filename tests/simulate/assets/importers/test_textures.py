"""Textures of glTF files: the right way up, transformed, multiplied, with alpha, and broken ones."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pxr import Usd, UsdGeom
from support.gltf_files import triangle
from support.model_imports import IMAGE, import_model, shown, textured

from aerojax.core.errors import UserError


def test_texture_arrives_the_right_way_up(tmp_path):
    textured(triangle()).write(tmp_path / "a.glb")
    mesh = import_model(tmp_path, "a.glb")
    assert shown(mesh) == [200, 40, 20]
    assert (tmp_path / "assets" / "model.png").is_file()
    stage = Usd.Stage.Open(str(tmp_path / "assets" / "model.usdc"))
    colour = UsdGeom.Mesh(next(p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh))).GetDisplayColorAttr().Get()
    linear = ((np.array([200, 40, 20]) / 255 + 0.055) / 1.055) ** 2.4
    assert np.array(colour)[0] == pytest.approx(linear, rel=1e-3)


def test_texture_transform_moves_it_to_the_lower_half(tmp_path):
    moved = {"extensions": {"KHR_texture_transform": {"offset": [0, 0.5]}}}
    glb = textured(triangle(), **moved)
    glb.tree["extensionsRequired"] = ["KHR_texture_transform"]
    glb.write(tmp_path / "a.glb")
    assert shown(import_model(tmp_path, "a.glb")) == [10, 60, 220]


def test_colour_factor_is_multiplied_in_linear_light(tmp_path):
    textured(triangle(), colour=(0.5, 0.5, 0.5, 1)).write(tmp_path / "a.glb")
    linear = 0.5 * ((np.array([200, 40, 20]) / 255 + 0.055) / 1.055) ** 2.4
    expected = (1.055 * linear ** (1 / 2.4) - 0.055) * 255
    assert shown(import_model(tmp_path, "a.glb")) == pytest.approx(expected, abs=1)


def test_alpha_is_kept_where_the_material_uses_it(tmp_path):
    image = np.concatenate([IMAGE, np.full((2, 4, 1), 99, np.uint8)], axis=2)
    glb = textured(triangle())
    encoded = cv2.imencode(".png", image[..., [2, 1, 0, 3]])[1].tobytes()
    glb.tree["images"][0]["bufferView"] = glb.view(encoded)
    glb.tree["materials"][0] |= {"alphaMode": "MASK", "alphaCutoff": 0.3}
    import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    written = cv2.imread(str(tmp_path / "assets" / "model.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(written[..., [2, 1, 0, 3]], image)


def test_two_textures_have_two_names(tmp_path):
    glb = textured(triangle())
    other = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 0, 0, 1]}
    glb.tree["materials"].append({"pbrMetallicRoughness": other})
    glb.tree["meshes"][0]["primitives"].append({**glb.tree["meshes"][0]["primitives"][0], "material": 1})
    mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    assert sorted(p.name for p in (tmp_path / "assets").glob("*.png")) == ["model.0.png", "model.1.png"]
    assert len(mesh.textures) == 2 and mesh.texture.tolist() == [0, 1]


def test_a_broken_texture_is_named(tmp_path):
    glb = textured(triangle())
    glb.tree["images"][0]["bufferView"] = glb.view(b"no picture")
    with pytest.raises(UserError, match="a texture is not a readable PNG or JPEG"):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))
