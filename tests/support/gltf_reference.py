"""An evaluation of GLB files for tests, written from the specification and apart from the importer.

One pass: every triangle mesh at one time, in the file's axes, by node matrices, linear-blend skinning and morph targets
with LINEAR and STEP samplers. SciPy does the rotations.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Reference:
    """A GLB file with its binary chunk."""

    def __init__(self, path: Path):
        data = path.read_bytes()
        length = struct.unpack_from("<I", data, 12)[0]
        self.tree = json.loads(data[20 : 20 + length])
        self.binary = data[28 + length :]

    def view(self, index: int) -> bytes:
        """Bytes of a buffer view."""
        view = self.tree["bufferViews"][index]
        return self.binary[view.get("byteOffset", 0) :][: view["byteLength"]]

    def accessor(self, index: int) -> np.ndarray:
        """Rows of a tightly packed, perhaps sparse accessor."""
        entry = self.tree["accessors"][index]
        width, count = WIDTH[entry["type"]], entry["count"]
        rows = np.zeros((count, width), TYPES[entry["componentType"]])
        if "bufferView" in entry:
            data = self.view(entry["bufferView"])[entry.get("byteOffset", 0) :]
            rows = np.frombuffer(data, rows.dtype, count * width).reshape(count, width).copy()
        if "sparse" in entry:
            where, what = entry["sparse"]["indices"], entry["sparse"]["values"]
            number = entry["sparse"]["count"]
            place = np.frombuffer(self.view(where["bufferView"]), TYPES[where["componentType"]], number)
            values = np.frombuffer(self.view(what["bufferView"]), rows.dtype, number * width)
            rows[place] = values.reshape(number, width)
        return rows

    def animated(self, seconds: float) -> dict[tuple[int, str], np.ndarray]:
        """Values of the first animation's channels, by node and path."""
        found = {}
        for clip in self.tree.get("animations", [])[:1]:
            for channel in clip["channels"]:
                sampler, target = clip["samplers"][channel["sampler"]], channel["target"]
                times = self.accessor(sampler["input"])[:, 0].astype(float)
                values = self.accessor(sampler["output"]).astype(float).reshape(len(times), -1)
                found[target["node"], target["path"]] = _sample(sampler, target["path"], times, values, seconds)
        return found

    def worlds(self, moved: dict[tuple[int, str], np.ndarray]) -> dict[int, np.ndarray]:
        """World matrix of every node."""
        nodes, worlds = self.tree["nodes"], {}

        def visit(index: int, parent: np.ndarray) -> None:
            node, local = nodes[index], np.eye(4)
            turn = moved.get((index, "rotation"), np.array(node.get("rotation", [0, 0, 0, 1.0])))
            size = moved.get((index, "scale"), np.array(node.get("scale", [1.0, 1, 1])))
            local[:3, :3] = Rotation.from_quat(turn).as_matrix() * size
            local[:3, 3] = moved.get((index, "translation"), np.array(node.get("translation", [0.0, 0, 0])))
            if "matrix" in node:
                local = np.array(node["matrix"]).reshape(4, 4).T
            worlds[index] = parent @ local
            for child in node.get("children", []):
                visit(child, worlds[index])

        for root in self.tree["scenes"][self.tree.get("scene", 0)]["nodes"]:
            visit(root, np.eye(4))
        return worlds

    def vertices(self, seconds: float | None) -> np.ndarray:
        """Every mesh's vertices in the world of the file; None means without any animation."""
        moved = {} if seconds is None else self.animated(seconds)
        worlds, posed = self.worlds(moved), []
        for index, world in worlds.items():
            node = self.tree["nodes"][index]
            if "mesh" not in node:
                continue
            mesh = self.tree["meshes"][node["mesh"]]
            weights = moved.get((index, "weights"), np.array(node.get("weights", mesh.get("weights", []))))
            for primitive in mesh["primitives"]:
                points = self.accessor(primitive["attributes"]["POSITION"]).astype(float)
                for weight, target in zip(weights, primitive.get("targets", []), strict=False):
                    points = points + weight * self.accessor(target["POSITION"])
                columns = np.concatenate([points, np.ones((len(points), 1))], axis=1)
                if "skin" in node:
                    posed.append(self._skinned(primitive, node["skin"], columns, worlds))
                else:
                    posed.append((columns @ world.T)[:, :3])
        return np.concatenate(posed)

    def _skinned(self, primitive: dict, skin: int, columns: np.ndarray, worlds: dict[int, np.ndarray]) -> np.ndarray:
        entry = self.tree["skins"][skin]
        inverse = self.accessor(entry["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        matrices = np.stack([worlds[j] @ m for j, m in zip(entry["joints"], inverse, strict=True)])
        joints = self.accessor(primitive["attributes"]["JOINTS_0"])
        weights = self.accessor(primitive["attributes"]["WEIGHTS_0"]).astype(float)
        return np.einsum("vk,vkij,vj->vi", weights, matrices[joints], columns)[:, :3]


def _sample(sampler: dict, path: str, times: np.ndarray, values: np.ndarray, seconds: float) -> np.ndarray:
    inside = float(np.clip(seconds, times[0], times[-1]))
    if sampler.get("interpolation", "LINEAR") == "STEP":
        return values[np.searchsorted(times, inside, side="right") - 1]
    if path == "rotation" and len(times) > 1:
        return Slerp(times, Rotation.from_quat(values))(inside).as_quat()
    return np.array([np.interp(inside, times, column) for column in values.T])
