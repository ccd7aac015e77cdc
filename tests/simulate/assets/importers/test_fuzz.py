"""Damaged models of every kind: they are read or refused in words, soon and without much memory.

Seeds are fixed; each run tries the same inputs. FUZZ_INPUTS in the environment tries more, FUZZ_SEED others.
"""

from __future__ import annotations

import os
import random
import resource
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from support.gltf_files import Glb, triangle
from support.model_imports import IMAGE, animate, textured
from support.mutations import mutated_bytes, mutated_glb, mutated_text
from support.usd_text import METRIC, write_usda

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.convert import convert_model
from aerojax.simulate.assets.importers.models import ImportedModel
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

INPUTS, SEED = int(os.environ.get("FUZZ_INPUTS", "40")), int(os.environ.get("FUZZ_SEED", "0"))
LONGEST_SECONDS = 20.0
"""For one input, on a busy machine: an unmutated one takes a fiftieth of a second."""
MOST_GIGABYTES = 1.0
"""By which the process may grow over all inputs of a kind."""


def _glb(folder: Path) -> bytes:
    """A textured triangle with a morph target, a skinned one with a clip, copies and a matrix."""
    glb: Glb = textured(triangle())
    primitive = glb.tree["meshes"][0]["primitives"][0]
    primitive["targets"] = [{"POSITION": glb.add([[0, 0, 0], [1, 0, 0], [0, 0, 0]])}]
    primitive["indices"] = glb.add([0, 1, 2], "uint16")
    influences = {"JOINTS_0": glb.add([[0, 1, 0, 0]] * 3, "uint8"), "WEIGHTS_0": glb.add([[0.5, 0.5, 0, 0]] * 3)}
    glb.tree["meshes"].append({"primitives": [{**primitive, "attributes": {**primitive["attributes"], **influences}}]})
    glb.tree["skins"] = [{"joints": [2, 3], "inverseBindMatrices": glb.add([np.eye(4).reshape(-1)] * 2)}]
    copies = {"attributes": {"TRANSLATION": glb.add([[5, 0, 0], [9, 0, 0]])}}
    glb.tree["nodes"] = [
        {"mesh": 0, "weights": [0.5], "matrix": np.eye(4).reshape(-1).tolist()},
        {"mesh": 1, "skin": 0},
        {"children": [3], "translation": [0, 0, 1]},
        {"rotation": [0, 0, 0, 1], "scale": [1, 1, 1]},
        {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": copies}},
    ]
    glb.tree["scenes"] = [{"nodes": [0, 1, 2, 4]}]
    animate(glb, "rotation", [0, 1], [[0, 0, 0, 1], [0, 0, 1, 0]], node=3)
    animate(glb, "weights", [0, 2], [0, 1], "STEP", node=0)
    return glb.write(folder / "seed.glb").read_bytes()


def _obj(folder: Path) -> bytes:
    assert cv2.imwrite(str(folder / "skin.png"), IMAGE)
    (folder / "model.mtl").write_text("newmtl red\nKd 1 0 0\nmap_Kd -s 1 1 1 skin.png\nNs 30\nd 0.5\n")
    return (
        b"mtllib model.mtl\no body\nv 0 0 0 1 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nvt 0 0\nvt 1 0\n"
        b"vn 0 0 1\nusemtl red\nf 1/1/1 2/2/1 3/1/1 4/2/1 5/1/1 6/2/1\ng rotor\nf -3//1 -2//1 -1//1\n"
    )


def _mtl(folder: Path) -> bytes:
    (folder / "seed.obj").write_bytes(_obj(folder))
    return (folder / "model.mtl").read_bytes()


def _usda(folder: Path) -> bytes:
    """A mesh with a colour and a hole, a shape, an instancer, samples, and a skeleton."""
    body = """def Xform "Root" {
        float3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 24: (0, 0, 8) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Mesh "body" {
          int[] faceVertexCounts = [3, 6]
          int[] faceVertexIndices = [0, 1, 2, 1, 2, 3, 4, 5, 0]
          int[] holeIndices = [0]
          point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]
          color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "uniform" )
          token visibility.timeSamples = { 0: "inherited", 5: "invisible" }
        }
        def Cylinder "mast" {
          double height = 2
          double radius.timeSamples = { 0: 1, 5: 2 }
          uniform token axis = "X"
          uniform token purpose = "render"
        }
        def PointInstancer "rotors" {
          point3f[] positions = [(0, 0, 0), (1, 0, 0)]
          int[] protoIndices = [0, 0]
          int64[] invisibleIds = [1]
          rel prototypes = </Root/rotors/one>
          def Mesh "one" { TRIANGLE }
        }
        def SkelRoot "skin" {
          def Skeleton "bones" {
            uniform token[] joints = ["a"]
            uniform matrix4d[] bindTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))]
            uniform matrix4d[] restTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))]
          }
          def Mesh "bent" (prepend apiSchemas = ["SkelBindingAPI"]) {
            TRIANGLE
            rel skel:skeleton = </Root/skin/bones>
            int[] primvars:skel:jointIndices = [0] ( interpolation = "constant" elementSize = 1 )
            float[] primvars:skel:jointWeights = [1] ( interpolation = "constant" elementSize = 1 )
          }
        }
      }""".replace('"constant" elementSize', '"constant"; elementSize')
    return write_usda(folder / "seed.usda", body, METRIC + "timeCodesPerSecond = 24; ").read_bytes()


def _stl(folder: Path) -> bytes:
    return trimesh.creation.box().export(file_type="stl")


def _ply(folder: Path) -> bytes:
    """Text with a colour and faces of three and four corners."""
    lines = [
        "ply\nformat ascii 1.0\nelement vertex 4",
        *(f"property {kind}" for kind in ("float x", "float y", "float z", "uchar red", "uchar green", "uchar blue")),
        "element face 2\nproperty list uchar int vertex_indices\nend_header",
        "0 0 0 255 0 0\n2 0 0 0 0 0\n2 1 0 0 0 0\n0 1 0 0 0 0\n4 0 1 2 3\n3 0 1 2\n",
    ]
    return "\n".join(lines).encode()


def _read(file: Path) -> None:
    model = ImportedModel("model", file, "drone", "test", "+X", "+Z", 1.0, "first", 1.0, "", "")
    stage = file.parent / "out" / f"{file.stem}.usdc"
    convert_model(model, stage)
    mesh = load_animated_mesh(stage)
    for share in (0.0, 0.4, 0.9):
        vertices = mesh.vertices_at(share * mesh.cycle_seconds)
        assert mesh.faces.max() < len(vertices) and np.isfinite(vertices).all()


KINDS = {
    "glb": (_glb, mutated_glb, "{}.glb"),
    "obj": (_obj, mutated_text, "{}.obj"),
    "mtl": (_mtl, mutated_text, "model.mtl"),
    "stl": (_stl, mutated_bytes, "{}.stl"),
    "ply": (_ply, mutated_text, "{}.ply"),
    "usda": (_usda, mutated_text, "{}.usda"),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # overflow of odd numbers on their way to a refusal
@pytest.mark.parametrize("kind", KINDS)
def test_damaged_models_are_read_or_refused(tmp_path, kind):
    seed, mutate, name = KINDS[kind]
    data = seed(tmp_path)
    before, refused = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, 0
    for number in range(-1, INPUTS):
        damaged = mutate(data, random.Random(f"{SEED} {kind} {number}")) if number >= 0 else data
        file = tmp_path / name.format(f"input_{number + 1}")
        file.write_bytes(damaged)
        model = tmp_path / f"input_{number + 1}.obj" if kind == "mtl" else file
        if kind == "mtl":
            model.write_bytes((tmp_path / "seed.obj").read_bytes())
        begun = time.monotonic()
        try:
            _read(model)
        except UserError as error:
            assert number >= 0, error  # the undamaged file is read
            refused += 1
        except Exception as error:
            raise AssertionError(f"{kind} {number}: {file} ended in {error!r}") from error
        assert time.monotonic() - begun < LONGEST_SECONDS, f"{kind} {number}: {file} took too long"
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 2**20
    assert grown < MOST_GIGABYTES and refused > 0
