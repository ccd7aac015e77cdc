"""glTF 2.0 containers: the JSON document, its buffers and images, and accessors as arrays.

Read here and not with a library: what an importer needs from glTF is the decoding of accessors and the evaluation of
skins, morph targets and animations, which readers of the container leave to their callers and mesh readers leave out.
Section numbers are those of the Khronos glTF 2.0 specification.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeGuard
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from jaxtyping import Num

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.beside import find_beside

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
        "KHR_materials_anisotropy",
        "KHR_materials_dispersion",
        "KHR_materials_iridescence",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_variants",
        "KHR_lights_punctual",
        "KHR_node_visibility",
        "KHR_xmp_json_ld",
        "EXT_mesh_gpu_instancing",
        "EXT_texture_webp",
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
    _sound: set[str] = field(default_factory=set, repr=False)  # arrays that were found to be lists of objects

    def items(self, kind: str) -> list[dict[str, Any]]:
        """A top-level array of the document ("nodes", "meshes" …); empty where it is absent."""
        found = self.json.get(kind, [])
        if kind not in self._sound:
            if not isinstance(found, list) or not all(isinstance(entry, dict) for entry in found):
                raise self.error(f"{kind} is not a list of objects")
            self._sound.add(kind)
        return found

    def entry(self, kind: str, index: Any, where: str) -> dict[str, Any]:
        """One entry of a top-level array, which the field `where` names."""
        found = self.items(kind)
        if not is_count(index) or index >= len(found):
            raise self.error(f"{where} names {kind}[{index!r}] of {len(found)}")
        return found[index]

    def vector(self, entry: dict[str, Any], key: str, default: tuple[float, ...], where: str) -> tuple[float, ...]:
        """Finite numbers of a field, as many as its default has."""
        found = entry.get(key, default)
        if (
            not isinstance(found, list | tuple)
            or len(found) != len(default)
            or not all(isinstance(v, int | float) and math.isfinite(v) for v in found)
        ):
            raise self.error(f"{where}.{key} is {found!r}, not {len(default)} finite numbers")
        return tuple(map(float, found))

    def number(self, entry: dict[str, Any], key: str, default: float, where: str) -> float:
        """One finite number of a field."""
        return self.vector({key: [entry[key]]} if key in entry else {}, key, (default,), where)[0]

    def error(self, problem: str, remedy: str = "export the model again") -> UserError:
        """A refusal of something in the document."""
        return UserError("invalid", f"{self.path}: {problem}", remedy)


def is_count(value: Any) -> TypeGuard[int]:
    """Whether a value of the JSON is a whole number that is not negative."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def read_document(path: Path) -> Document:
    """Read a `.glb` or `.gltf` with its external buffers.

    Raises:
        UserError: if the file or a buffer is missing, is not glTF 2.0, or needs an extension that is not read.
    """
    data = path.read_bytes()
    text, binary = _glb_chunks(path, data) if path.suffix.lower() == ".glb" else (data, None)
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UserError(
            "unreadable", f"{path}: the JSON of this glTF file cannot be read ({error})", "export it again"
        ) from error
    if not isinstance(tree, dict) or not isinstance(tree.get("asset", {}), dict):
        raise UserError("unreadable", f"{path}: the JSON of this glTF file is no glTF document", "export it again")
    version = str(tree.get("asset", {}).get("version", "absent"))
    if not version.startswith("2."):
        raise UserError("invalid", f"{path}: asset.version is {version}", "export the model as glTF 2.0")
    required = tree.get("extensionsRequired", [])
    unknown = sorted(set(map(str, required if isinstance(required, list) else [required])) - READABLE_EXTENSIONS)
    if unknown:
        raise UserError(
            "unreadable",
            f"{path}: extensionsRequired names {', '.join(unknown)}, which is not read",
            "export without compression",
        )
    buffers = tuple(_buffer(path, entry, binary) for entry in Document(path, tree, ()).items("buffers"))
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
    if "EXT_meshopt_compression" in entry.get("extensions", {}):
        raise UserError("unreadable", f"{path}: EXT_meshopt_compression is not read", "export without compression")
    if binary is None:
        raise UserError("missing", f"{path}: a buffer has no uri and the file no binary chunk", "export it again")
    return binary


def _resource(path: Path, uri: Any) -> bytes:
    """Bytes of a data URI or of a file beside the document."""
    if not isinstance(uri, str):
        raise UserError("invalid", f"{path}: uri is {uri!r}", "export the model again")
    if uri.startswith("data:"):
        head, _, body = uri.partition(",")
        try:
            return base64.b64decode(body, validate=True) if head.endswith(";base64") else unquote_to_bytes(body)
        except (binascii.Error, ValueError) as error:
            raise UserError(
                "unreadable", f"{path}: a data URI is not valid base64", "export the model again"
            ) from error
    beside = find_beside(path.parent, unquote(uri))
    if beside is None:
        raise UserError("missing", f"{path}: {uri} is missing", "keep it beside the model or export as .glb")
    return beside.read_bytes()


def image_bytes(document: Document, index: int) -> bytes:
    """The encoded image number `index` (PNG, JPEG or WebP)."""
    entry = document.entry("images", index, "textures[…].source")
    return _resource(document.path, entry["uri"]) if "uri" in entry else _view(document, entry.get("bufferView"))


def _view(document: Document, index: Any) -> bytes:
    view = document.entry("bufferViews", index, "bufferView")
    start, length, buffer = view.get("byteOffset", 0), view.get("byteLength"), view.get("buffer")
    if "EXT_meshopt_compression" in view.get("extensions", {}):
        raise document.error("EXT_meshopt_compression is not read", "export without compression")
    if not is_count(buffer) or buffer >= len(document.buffers) or not is_count(start) or not is_count(length):
        raise document.error(f"bufferViews[{index}] names bytes {start!r} + {length!r} of buffers[{buffer!r}]")
    data = document.buffers[buffer][start : start + length]
    if len(data) < length:
        raise document.error(f"bufferViews[{index}] reaches past its buffer")
    return data


def read_accessor(
    document: Document, index: Any, where: str, types: tuple[str, ...], *, finite: bool = True
) -> Num[np.ndarray, "element component"]:
    """An accessor as rows (§3.6.2): strides, sparse substitution and normalised integers are resolved.

    Matrices keep glTF's column-major order. Normalised integers become float32, others keep their type.

    Args:
        document: that holds it.
        index: its number as the document gives it.
        where: the field that names it.
        types: what it may be ("SCALAR", "VEC3" …).
        finite: whether values must be.

    Raises:
        UserError: it contradicts itself, reaches past its bytes or is of another type. Sizes are checked before
            anything is made of them.
    """
    entry, name = document.entry("accessors", index, where), f"accessors[{index}]"
    count, offset, code = entry.get("count"), entry.get("byteOffset", 0), entry.get("componentType")
    if code not in _COMPONENTS or entry.get("type") not in _WIDTHS or not is_count(count) or not is_count(offset):
        raise document.error(f"{name} has no known componentType, type, count or byteOffset")
    if entry["type"] not in types:
        raise document.error(f"{where} names {name} of type {entry['type']}, not {' or '.join(types)}")
    kind, width = np.dtype(_COMPONENTS[code]).newbyteorder("<"), _WIDTHS[entry["type"]]
    if "bufferView" in entry:
        rows = _rows(document, entry["bufferView"], offset, count, width, kind)
    elif count > sum(map(len, document.buffers)):  # of zeros, to be substituted; others of its mesh do have their bytes
        raise document.error(f"{name} has {count} elements and no bufferView")
    else:
        rows = np.zeros((count, width), kind)
    if "sparse" in entry:
        rows = _substituted(document, rows, entry["sparse"], name)
    if finite and kind.kind == "f" and not np.isfinite(rows).all():
        raise document.error(f"{where} names {name}, which holds values that are not finite")
    if entry.get("normalized") and kind.kind != "f":  # §3.6.2.2: signed integers reach -1 at -max
        return np.maximum(rows.astype(np.float32) / np.iinfo(kind.type).max, -1.0)  # pyrefly: ignore
    return rows.astype(kind.newbyteorder("="))


def _rows(
    document: Document, view: Any, offset: int, count: int, width: int, kind: np.dtype
) -> Num[np.ndarray, "element component"]:
    data, packed = _view(document, view), width * kind.itemsize
    stride = document.items("bufferViews")[view].get("byteStride", 0) or packed
    if not is_count(stride) or stride < packed:
        raise document.error(f"bufferViews[{view}].byteStride is {stride!r}, less than an element")
    if count and offset + stride * (count - 1) + packed > len(data):
        raise document.error(f"an accessor reaches past bufferViews[{view}]")
    if not count:
        return np.zeros((0, width), kind)
    return np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize)).copy()


def _substituted(document: Document, rows: np.ndarray, sparse: dict[str, Any], name: str) -> np.ndarray:
    """Replace the rows that a sparse accessor names (§3.6.2.3)."""
    where, what, count = sparse["indices"], sparse["values"], sparse.get("count")
    code, starts = where.get("componentType"), (where.get("byteOffset", 0), what.get("byteOffset", 0))
    if code not in (5121, 5123, 5125) or not is_count(count) or not all(map(is_count, starts)):
        raise document.error(f"{name}.sparse has no known componentType, count or byteOffset")
    kind = np.dtype(_COMPONENTS[code]).newbyteorder("<")
    index = _rows(document, where.get("bufferView"), starts[0], count, 1, kind)[:, 0].astype(np.int64)
    if count and index.max() >= len(rows):
        raise document.error(f"{name}.sparse names element {index.max()} of {len(rows)}")
    rows[index] = _rows(document, what.get("bufferView"), starts[1], count, rows.shape[1], rows.dtype)
    return rows
