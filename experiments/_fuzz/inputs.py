"""Small inputs of every format that are right, made by our own writers or by hand; the same bytes wherever they run."""

from __future__ import annotations

import base64
import io
import json
import pickle
import struct
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import jax
import jax.numpy as jnp
import numpy as np

from aerojax.classify.base import untrained
from aerojax.classify.load import save_classifier
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.types import Gaussians
from aerojax.data.clips import save_clip
from aerojax.gaussians.io.ply import write_ply
from aerojax.gaussians.io.usd import write_usd
from aerojax.geometry.cameras import look_at

WIDTH, HEIGHT, FRAMES, CAMERAS = 24, 18, 2, 3
Files = dict[str, bytes]


def written(name: str, write: Callable[[Path], object]) -> bytes:
    """What a writer leaves in a file of this name."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path)
        return path.read_bytes()


def gaussians(count: int = 3, coefficients: int = 4) -> Gaussians:
    """Random Gaussians about the origin."""
    rng = np.random.default_rng(0)
    turned = rng.normal(size=(count, 4))
    return Gaussians(
        jnp.asarray(rng.normal(0, 0.3, (count, 3)), jnp.float32),
        jnp.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True), jnp.float32),
        jnp.asarray(rng.uniform(0.03, 0.2, (count, 3)), jnp.float32),
        jnp.asarray(rng.uniform(0.1, 0.9, count), jnp.float32),
        jnp.asarray(rng.normal(0, 0.4, (count, coefficients, 3)), jnp.float32),
    )


def splat_plys() -> tuple[Files, ...]:
    """Binary of both byte orders, ascii, with faces, with the smoothing filter, and far from the origin."""
    plain = written("a.ply", lambda path: write_ply(path, gaussians()))
    far = written(
        "a.ply", lambda path: write_ply(path, gaussians(coefficients=1), origin=np.array([4.5e5, 5.6e6, 9.0]))
    )
    head, body = plain.split(b"end_header\n")
    rows = np.frombuffer(body, "<f4").reshape(3, -1)
    text = "\n".join(" ".join(f"{x:.7g}" for x in row) for row in rows).encode()
    smoothed = np.concatenate([rows, np.full((3, 1), 0.1)], axis=1).astype("<f4").tobytes()
    faces = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    contents = (
        plain,
        head.replace(b"little", b"big") + b"end_header\n" + rows.astype(">f4").tobytes(),
        head.replace(b"binary_little_endian", b"ascii") + b"end_header\n" + text,
        head + faces + body + b"\x03" + bytes(12),
        head + b"property float filter_3D\nend_header\n" + smoothed,
    )
    return (*({"a.ply": content} for content in contents), {"far.ply": far})


def compressed_plys() -> tuple[Files, ...]:
    """SuperSplat's layout, with and without higher coefficients."""
    bounds = [f"{end}_{name}" for name in ("x", "y", "z") for end in ("min", "max")]
    bounds += [f"{end}_scale_{name}" for name in ("x", "y", "z") for end in ("min", "max")]
    words = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
    lines = ["ply", "format binary_little_endian 1.0", "element chunk 1", *(f"property float {b}" for b in bounds)]
    lines += ["element vertex 2", *(f"property uint {word}" for word in words)]
    body = np.array([-1, 1] * 3 + [-4, -2] * 3, "<f4").tobytes()
    body += np.random.default_rng(1).integers(0, 2**32, 8, dtype=np.uint32).tobytes()
    more = ["element sh 2", *(f"property uchar f_rest_{i}" for i in range(9))]
    plain = "\n".join([*lines, "end_header\n"]).encode() + body
    return {"a.ply": plain}, {"a.ply": "\n".join([*lines, *more, "end_header\n"]).encode() + body + bytes(range(18))}


def splat_stages() -> tuple[Files, ...]:
    """Text and binary, still and moving."""
    frames = [gaussians(), gaussians(2)]
    return (
        {"a.usda": written("a.usda", lambda path: write_usd(path, frames[:1]))},
        {"a.usda": written("a.usda", lambda path: write_usd(path, frames, origin=np.array([1e5, 0.0, 0.0])))},
        {"a.usdc": written("a.usdc", lambda path: write_usd(path, frames))},
    )


def picture(camera: int, frame: int, suffix: str, *, mask: bool = False) -> bytes:
    """An image of noise with a bright block, or the block's mask."""
    image = np.random.default_rng([camera, frame]).integers(0, 90, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    image[6:12, 8:15] = 200
    done, data = cv2.imencode(suffix, (image[..., 0] == 200).astype(np.uint16) if mask else image)
    assert done  # encoding to memory fails only for shapes and types that are not these
    return data.tobytes()


def film() -> bytes:
    """A video of the same pictures."""

    def write(path: Path) -> None:
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, (WIDTH, HEIGHT))
        for frame in range(FRAMES):
            writer.write(cv2.imdecode(np.frombuffer(picture(0, frame, ".png"), np.uint8), cv2.IMREAD_COLOR))
        writer.release()

    return written("a.mp4", write)


def capture(suffix: str, *, truth: bool = False, video: bool = False) -> Files:
    """A capture of three cameras and two frames."""
    files: Files = {}
    cameras = []
    for index in range(CAMERAS):
        angle = 2 * np.pi * index / CAMERAS
        place = look_at(np.array([5 * np.cos(angle), 5 * np.sin(angle), 2.0]), np.zeros(3))
        name = f"c{index}"
        rgb = f"{name}.mp4" if video else f"{name}/{{frame:03d}}{suffix}"
        camera: dict[str, Any] = {"name": name, "width": WIDTH, "height": HEIGHT, "rgb": rgb}
        camera |= {"K": [[40.0, 0, 12.0], [0, 40.0, 9.0], [0, 0, 1]], "world_from_cam": place.tolist()}
        camera |= {"distortion": {"model": "none", "coefficients": []}, "mask": f"{name}/m{{frame}}.png"}
        cameras.append(camera)
        for frame in range(FRAMES):
            files[f"{name}/m{frame}.png"] = picture(index, frame, ".png", mask=True)
            if not video:
                files[f"{name}/{frame:03d}{suffix}"] = picture(index, frame, suffix)
        if video:
            files[f"{name}.mp4"] = film()
    head: dict[str, Any] = {"format": "aerojax-capture", "version": 1, "fps": 30.0, "frames": FRAMES}
    content = {**head, "cameras": cameras, **({"truth": "truth.json"} if truth else {})}
    files["capture.json"] = json.dumps(content).encode()
    return files | ({"truth.json": flight()} if truth else {})


def flight() -> bytes:
    """The truth of that capture."""
    boxes = {f"c{index}": [8.0, 6.0, 15.0, 12.0] for index in range(CAMERAS)}
    seen = dict.fromkeys(boxes, True)
    states = [
        {"frame": f, "position": [0.0, 0, 0], "orientation_wxyz": [1.0, 0, 0, 0], "bbox": boxes, "visible": seen}
        for f in range(FRAMES)
    ]
    one = {"id": 1, "class": "drone", "identity": "x", "source": "aerojax", "licence": "Apache-2.0", "frames": states}
    return json.dumps({"objects": [one]}).encode()


def weights() -> bytes:
    """A classifier with next to no parameters, all of them zero: drawing them would compile for a minute."""
    config = MambaSplatConfig(d_model=2, depth=1, heads=1, head_dim=1, mamba_layers=1, d_state=1, channels=2)
    shapes = jax.eval_shape(lambda key: untrained(config, tokens=4, frames=2, key=key), jax.random.key(0))
    model = jax.tree.map(lambda leaf: np.zeros(leaf.shape, leaf.dtype), shapes)
    return written("a.safetensors", lambda path: save_classifier(path, model))


def torch_archive() -> bytes:
    """A state dict of two tensors as `torch.save` writes it: opcodes of pickle protocol 2 in a zip archive."""

    def text(value: str) -> bytes:
        return pickle.dumps(value, protocol=2)[2:-1]

    def tensor(key: str, count: int) -> bytes:
        size = b"K" + bytes([count])
        note = b"(" + text("storage") + b"ctorch\nFloatStorage\n" + text(key) + text("cpu") + size + b"tQ"
        layout = b"K\0(" + size + b"t(K\x01t\x89"  # offset, size, stride, no gradient
        return b"ctorch._utils\n_rebuild_tensor_v2\n(" + note + layout + b"ccollections\nOrderedDict\n)RtR"

    items = text("a.weight") + tensor("0", 4) + text("a.bias") + tensor("1", 2)
    content = b"\x80\x02ccollections\nOrderedDict\n)R(" + items + b"u."
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in (("data.pkl", content), ("byteorder", b"little"), ("version", b"3\n")):
            archive.writestr(zipfile.ZipInfo(f"archive/{name}"), data)
        for key, count in (("0", 4), ("1", 2)):
            archive.writestr(zipfile.ZipInfo(f"archive/data/{key}"), np.arange(count, dtype="<f4").tobytes())
    return file.getvalue()


def clip() -> bytes:
    """Two frames of three Gaussians."""
    columns = np.stack([np.asarray(gaussians().columns())] * 2)
    return written("a.npz", lambda path: save_clip(path, columns, "drone", "x"))


def manifest() -> bytes:
    """A data set of one sequence."""
    identity = {"name": "d", "class": "drone", "family": "quad", "split": "test", "asset": "assets/d.usdc"}
    sequence: dict[str, Any] = {"name": "s", "folder": "test/s", "class": "drone", "identity": "d", "split": "test"}
    sequence |= {"rig": "sim1", "frames": 2, "fps": 30.0, "cameras": 3, "distance_m": 5.0, "radius_m": 5.0}
    sequence |= {"objects": [{"id": 1, "identity": "d"}], "frames_below_min_cameras": []}
    content: dict[str, Any] = {"format": "aerojax-dataset", "version": 1, "seed": 0, "licence": "CC-BY-4.0"}
    content |= {"rigs": {"sim1": {"config": {"kind": "ring"}, "versions": {"jax": "0"}, "commit": None}}}
    content |= {"counts": {"test": {"drone": 1}}, "sequences": [sequence]}
    content |= {"identities": [{**identity, "licence": "Apache-2.0", "source": "aerojax"}]}
    return json.dumps(content).encode()


WAVEFRONT = b"""mtllib a.mtl
o box
v 0 0 0
v 1 0 0
v 1 1 0 1 0 0
v 0 1 0.5
vt 0 0
vt 1 1
vn 0 0 1
usemtl red
f 1/1/1 2/2/1 3/1/1 4/2/1
f -1 -2 -3
"""
LIBRARY = b"newmtl red\nKd 1 0 0\nd 0.5\nPr 0.4\n"
STAGE = b"""#usda 1.0
(
    defaultPrim = "W"
    upAxis = "Z"
    metersPerUnit = 1
    startTimeCode = 0
    endTimeCode = 2
)
def Xform "W"
{
    float xformOp:rotateZ.timeSamples = { 0: 0, 2: 90 }
    uniform token[] xformOpOrder = ["xformOp:rotateZ"]
    def Mesh "M"
    {
        int[] faceVertexCounts = [4, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 0, 1, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0.5)]
        color3f[] primvars:displayColor = [(1, 0, 0)]
    }
    def Sphere "S"
    {
        double radius = 0.2
    }
}
"""
LIST = b"""models:
- name: box
  file: box.obj
  class: drone
  split: test
  forward: +X
  up: +Z
  scale: 1.0
- name: other
  file: other.glb
  class: bird
  animation: first
  speed: 2
"""


def gltf_tree(binary: bytes, uri: str | None) -> dict[str, Any]:
    """An animated, skinned triangle."""
    tree: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}]}
    tree["nodes"] = [{"mesh": 0, "skin": 0, "name": "m"}, {"name": "j", "translation": [0.0, 0.0, 1.0]}]
    attributes = {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}
    tree["meshes"] = [{"primitives": [{"attributes": attributes, "indices": 3, "material": 0}]}]
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "metallicFactor": 0.5}}]
    tree["skins"] = [{"joints": [1], "inverseBindMatrices": 4}]
    sampler, channel = {"input": 5, "output": 6}, {"sampler": 0, "target": {"node": 1, "path": "translation"}}
    tree["animations"] = [{"name": "fly", "samplers": [sampler], "channels": [channel]}]
    tree["buffers"] = [{"byteLength": len(binary), **({} if uri is None else {"uri": uri})}]
    return tree


def gltf_models() -> tuple[dict[str, Any], bytes]:
    """The document with its accessors, and the bytes that they show."""
    parts = (
        (np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4"), 5126, "VEC3"),
        (np.zeros((3, 4), "u1"), 5121, "VEC4"),
        (np.array([[1, 0, 0, 0]] * 3, "<f4"), 5126, "VEC4"),
        (np.array([[0], [1], [2], [0]], "<u2"), 5123, "SCALAR"),
        (np.eye(4, dtype="<f4").reshape(1, 16), 5126, "MAT4"),
        (np.array([[0], [1]], "<f4"), 5126, "SCALAR"),
        (np.array([[0, 0, 1], [0, 0, 2]], "<f4"), 5126, "VEC3"),
    )
    binary, views, accessors = b"", [], []
    for index, (rows, component, kind) in enumerate(parts):
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": rows.nbytes})
        count = 3 if kind == "SCALAR" and component == 5123 else len(rows)
        accessors.append({"bufferView": index, "componentType": component, "count": count, "type": kind})
        binary += rows.tobytes()
    accessors[0] |= {"min": [0, 0, 0], "max": [1, 1, 0]}
    uri = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    return gltf_tree(binary, uri) | {"bufferViews": views, "accessors": accessors}, binary


def gltf() -> Files:
    """The model as text with its bytes in it."""
    return {"a.gltf": json.dumps(gltf_models()[0]).encode()}


def glb() -> Files:
    """The model as one binary file."""
    tree, binary = gltf_models()
    tree["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return {"a.glb": struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks}


def meshes() -> tuple[Files, ...]:
    """A triangle as STL, text and binary, and a triangle and a square as PLY."""
    corners = np.array([[0, 0, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")  # its normal first
    rows = "\n".join("vertex " + " ".join(map(str, corner)) for corner in corners[1:].tolist())
    text = f"solid a\nfacet normal 0 0 1\nouter loop\n{rows}\nendloop\nendfacet\nendsolid a\n"
    binary = bytes(80) + struct.pack("<I", 1) + corners.tobytes() + bytes(2)
    lines = ["ply", "format ascii 1.0", "element vertex 4", *(f"property float {axis}" for axis in "xyz")]
    lines += ["element face 2", "property list uchar int vertex_indices", "end_header"]
    lines += ["0 0 0", "1 0 0", "1 1 0", "0 1 0.5", "3 0 1 2", "4 0 1 2 3", ""]
    return {"a.stl": text.encode()}, {"a.stl": binary}, {"a.ply": "\n".join(lines).encode()}


def wavefront() -> Files:
    """A box's corner with its library."""
    return {"a.obj": WAVEFRONT, "a.mtl": LIBRARY}


def stage() -> Files:
    """A turning mesh and a sphere."""
    return {"a.usda": STAGE}


def models() -> Files:
    """A list of two models, and the models."""
    return {"a.yaml": LIST, "box.obj": WAVEFRONT, "other.glb": glb()["a.glb"]}
