"""Small GLB files that tests write."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Glb:
    """A document that grows: accessors and views are appended, the rest is plain JSON in `tree`."""

    def __init__(self) -> None:
        self.tree: dict[str, Any] = {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": []}
        self.binary = b""

    def view(self, data: bytes, **fields: Any) -> int:
        """Append bytes and return the view's number."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        entry = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), **fields}
        self.tree["bufferViews"].append(entry)
        self.binary += data
        return len(self.tree["bufferViews"]) - 1

    def add(self, rows: Any, kind: str = "float32", **fields: Any) -> int:
        """Append an accessor of rows and return its number."""
        array = np.asarray(rows, kind)
        array = array.reshape(len(array), -1)
        entry = {"bufferView": self.view(array.tobytes()), "count": len(array)}
        return self.entry({**entry, "componentType": COMPONENTS[kind], "type": TYPES[array.shape[1]], **fields})

    def entry(self, entry: dict[str, Any]) -> int:
        """Append an accessor as it is."""
        self.tree["accessors"].append(entry)
        return len(self.tree["accessors"]) - 1

    def write(self, path: Path) -> Path:
        """Write the file."""
        tree = {**self.tree, "buffers": [{"byteLength": len(self.binary)}]}
        text = json.dumps(tree).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
        path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)
        return path


def triangle(name: str = "part") -> Glb:
    """One node with one triangle in the plane z = 0."""
    glb = Glb()
    points = glb.add([[0, 0, 0], [2, 0, 0], [0, 1, 0]])
    glb.tree |= {
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": name, "mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": points}}]}],
    }
    return glb
