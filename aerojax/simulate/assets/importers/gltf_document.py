"""glTF 2.0 containers: the JSON document, its buffers and images, and accessors as arrays.

Read here and not with a library: what an importer needs from glTF is the decoding of accessors and the evaluation of
skins, morph targets and animations, which readers of the container leave to their callers and mesh readers leave out.
Section numbers are those of the Khronos glTF 2.0 specification.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from jaxtyping import Num

from aerojax.core.errors import UserError

READABLE_EXTENSIONS = frozenset(
    {
        "KHR_mesh_quantization",
        "KHR_texture_transform",
        "KHR_materials_unlit",
        "KHR_materials_specular",
        "KHR_materials_ior",
        "KHR_materials_emissive_strength",
        "KHR_materials_clearcoat",
        "KHR_materials_sheen",
        "KHR_materials_transmission",
        "KHR_materials_volume",
        "KHR_lights_punctual",
    }
)
"""Extensions that a file may require: read, or without bearing on the shape, the motion and the base colour."""

_COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_GLB_MAGIC, _JSON_CHUNK, _BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942


@dataclass(frozen=True)
class Document:
    """A glTF file: where it lies, its JSON and the bytes of its buffers."""

    path: Path
    json: dict[str, Any]
    buffers: tuple[bytes, ...]

    def items(self, kind: str) -> list[dict[str, Any]]:
        """A top-level array of the document ("nodes", "meshes" …); empty where it is absent."""
        return self.json.get(kind, [])


def read_document(path: Path) -> Document:
    """Read a `.glb` or `.gltf` with its external buffers.

    Raises:
        UserError: if the file or a buffer is missing, is not glTF 2.0, or needs an extension that is not read.
    """
    data = path.read_bytes()
    text, binary = _glb_chunks(path, data) if path.suffix.lower() == ".glb" else (data, None)
    try:
        tree = json.loads(text)
    except ValueError as error:
        raise UserError(
            "unreadable", f"{path}: the JSON of this glTF file cannot be read ({error})", "export it again"
        ) from error
    version = str(tree.get("asset", {}).get("version", "absent"))
    if not version.startswith("2."):
        raise UserError("invalid", f"{path}: asset.version is {version}", "export the model as glTF 2.0")
    unknown = sorted(set(tree.get("extensionsRequired", [])) - READABLE_EXTENSIONS)
    if unknown:
        raise UserError(
            "unreadable",
            f"{path}: extensionsRequired names {', '.join(unknown)}, which is not read",
            "export without compression",
        )
    buffers = tuple(_buffer(path, entry, binary) for entry in tree.get("buffers", []))
    return Document(path, tree, buffers)


def _glb_chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """JSON and binary chunk of a GLB (§4.4)."""
    if len(data) < 20 or struct.unpack_from("<I", data)[0] != _GLB_MAGIC:
        raise UserError(
            "mismatch", f"{path}: not a GLB file (its first bytes differ)", "export the model as glTF binary"
        )
    chunks, at = {}, 12
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        if at + 8 + length > len(data):
            raise UserError("invalid", f"{path}: the GLB file ends within a chunk", "copy or export it again")
        chunks[kind] = data[at + 8 : at + 8 + length]
        at += 8 + length
    if _JSON_CHUNK not in chunks:
        raise UserError("missing", f"{path}: the GLB file has no JSON chunk", "export it again")
    return chunks[_JSON_CHUNK], chunks.get(_BINARY_CHUNK)


def _buffer(path: Path, entry: dict[str, Any], binary: bytes | None) -> bytes:
    if "uri" in entry:
        return _resource(path, entry["uri"])
    if binary is None:
        raise UserError("missing", f"{path}: a buffer has no uri and the file no binary chunk", "export it again")
    return binary


def _resource(path: Path, uri: str) -> bytes:
    """Bytes of a data URI or of a file beside the document."""
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except binascii.Error as error:
            raise UserError(
                "unreadable", f"{path}: a data URI is not valid base64", "export the model again"
            ) from error
    beside = path.parent / unquote(uri)
    if not beside.is_file():
        raise UserError("missing", f"{path}: {uri} is missing", "keep it beside the model or export as .glb")
    return beside.read_bytes()


def image_bytes(document: Document, index: int) -> bytes:
    """The encoded image number `index` (PNG or JPEG)."""
    entry = document.items("images")[index]
    return _resource(document.path, entry["uri"]) if "uri" in entry else _view(document, entry["bufferView"])


def _view(document: Document, index: int) -> bytes:
    view = document.items("bufferViews")[index]
    start = view.get("byteOffset", 0)
    data = document.buffers[view["buffer"]][start : start + view["byteLength"]]
    if len(data) < view["byteLength"]:
        raise UserError(
            "invalid", f"{document.path}: bufferViews[{index}] reaches past its buffer", "export the model again"
        )
    return data


def read_accessor(document: Document, index: int) -> Num[np.ndarray, "element component"]:
    """An accessor as rows (§3.6.2): strides, sparse substitution and normalised integers are resolved.

    Matrices keep glTF's column-major order. Normalised integers become float32, others keep their type.
    """
    entry = document.items("accessors")[index]
    kind, width = np.dtype(_COMPONENTS[entry["componentType"]]).newbyteorder("<"), _WIDTHS[entry["type"]]
    if "bufferView" in entry:
        stride = document.items("bufferViews")[entry["bufferView"]].get("byteStride")
        rows = _rows(document, entry["bufferView"], entry.get("byteOffset", 0), entry["count"], width, kind, stride)
    else:
        rows = np.zeros((entry["count"], width), kind)
    if "sparse" in entry:
        rows = _substituted(document, rows, entry["sparse"])
    if entry.get("normalized"):  # §3.6.2.2: signed integers reach -1 at -max
        return np.maximum(rows.astype(np.float32) / np.iinfo(kind.type).max, -1.0)  # pyrefly: ignore
    return rows.astype(kind.newbyteorder("="))


def _rows(
    document: Document, view: int, offset: int, count: int, width: int, kind: np.dtype, stride: int | None
) -> Num[np.ndarray, "element component"]:
    data, packed = _view(document, view), width * kind.itemsize
    stride = stride or packed
    if offset + stride * (count - 1) + packed > len(data):
        raise UserError(
            "invalid", f"{document.path}: an accessor reaches past bufferViews[{view}]", "export the model again"
        )
    return np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize)).copy()


def _substituted(document: Document, rows: np.ndarray, sparse: dict[str, Any]) -> np.ndarray:
    """Replace the rows that a sparse accessor names (§3.6.2.3)."""
    where, what, count = sparse["indices"], sparse["values"], sparse["count"]
    kind = np.dtype(_COMPONENTS[where["componentType"]]).newbyteorder("<")
    index = _rows(document, where["bufferView"], where.get("byteOffset", 0), count, 1, kind, None)[:, 0]
    rows[index] = _rows(document, what["bufferView"], what.get("byteOffset", 0), count, rows.shape[1], rows.dtype, None)
    return rows
