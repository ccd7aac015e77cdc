"""Models that the tests write, listed and converted as users would."""

from __future__ import annotations

import cv2
import numpy as np
from pxr import Usd, UsdValidation

from aerojax.simulate.assets.catalogue import build_identity
from aerojax.simulate.assets.importers.identities import imported_identities
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

AXES = "scale: 1.0, forward: +X, up: +Z"
IMAGE = np.zeros((2, 4, 3), np.uint8)
IMAGE[0], IMAGE[1] = (200, 40, 20), (10, 60, 220)  # RGB of the upper and the lower half


def write_list(folder, file, fields=AXES, name="model", label="bird"):
    """A list of one model."""
    path = folder / "models.yaml"
    path.write_text(f"models:\n  - {{name: {name}, file: {file}, class: {label}, {fields}}}\n")
    return path


def import_model(folder, file, fields=AXES, label="bird"):
    """Convert one model and load the stage, which must be valid."""
    identity = imported_identities(write_list(folder, file, fields, label=label))[0]
    path = build_identity(identity, folder / "assets")
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))
    assert [e.GetMessage() for e in errors] == []
    return load_animated_mesh(path)


def centred(points):
    """Points with the middle of their bounding box at the origin."""
    points = np.asarray(points, float)
    return points - (points.min(0) + points.max(0)) / 2


def relative(mesh, seconds):
    """Vertices relative to the first one, which stays where it is in these files."""
    vertices = mesh.vertices_at(seconds)
    return vertices - vertices[0]


def shown(mesh, face=0):
    """The texel in the middle of a face."""
    u, v = mesh.uv[face].mean(axis=0)
    image = mesh.textures[mesh.texture[face]]
    return image[int((1 - v) % 1 * image.shape[0]), int(u % 1 * image.shape[1])].tolist()


def animate(glb, path, times, values, interpolation="LINEAR", node=0):
    """Add a clip of one channel."""
    sampler = {"input": glb.add(times), "output": glb.add(values), "interpolation": interpolation}
    channel = {"sampler": 0, "target": {"node": node, "path": path}}
    glb.tree.setdefault("animations", []).append({"name": path, "samplers": [sampler], "channels": [channel]})


def textured(glb, colour=(1, 1, 1, 1), uv=((0, 0), (1, 0), (0, 0.4)), **reference):
    """Give the triangle of a GLB the texture `IMAGE`; these coordinates lie in its upper half."""
    encoded = cv2.imencode(".png", IMAGE[..., ::-1])[1].tobytes()
    glb.tree["images"] = [{"bufferView": glb.view(encoded), "mimeType": "image/png"}]
    glb.tree["textures"] = [{"source": 0}]
    surface = {"baseColorTexture": {"index": 0, **reference}, "baseColorFactor": list(colour)}
    glb.tree["materials"] = [{"name": "paint", "pbrMetallicRoughness": surface}]
    primitive = glb.tree["meshes"][0]["primitives"][0]
    primitive["material"] = 0
    primitive["attributes"]["TEXCOORD_0"] = glb.add(uv)
    return glb
