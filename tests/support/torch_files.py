"""Files as `torch.save` writes them, made without torch: opcodes of pickle protocol 2 and a zip archive or a stream."""

from __future__ import annotations

import math
import pickle
import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

KINDS = {
    "f4": "FloatStorage",
    "f8": "DoubleStorage",
    "f2": "HalfStorage",
    "i8": "LongStorage",
    "i4": "IntStorage",
    "u1": "ByteStorage",
    "b1": "BoolStorage",
}


class Tensor(NamedTuple):
    """A tensor by its parts, for those that no NumPy array describes."""

    storage: np.ndarray
    kind: str
    offset: int
    size: tuple[int, ...]
    stride: tuple[int, ...]
    parameter: bool = False


def name_of(module: str, name: str) -> bytes:
    """The opcode that looks a name up."""
    return f"c{module}\n{name}\n".encode()


class Writer:
    """Opcodes of one value, and the storages that it named."""

    def __init__(self, *, stream: bool = False):
        self.storages: list[bytes] = []
        self.counts: list[int] = []
        self.stream = stream

    def value(self, value: Any) -> bytes:
        """Opcodes of a plain value, an array, a `Tensor`, or bytes that are opcodes already."""
        match value:
            case bytes():
                return value
            case Tensor():
                return self.tensor(value)
            case np.ndarray():
                strides = tuple(math.prod(value.shape[axis + 1 :]) for axis in range(value.ndim))
                return self.tensor(Tensor(value.ravel(), KINDS[value.dtype.str[1:]], 0, value.shape, strides))
            case tuple():
                return b"(" + b"".join(map(self.value, value)) + b"t"
            case Mapping():
                items = b"".join(self.value(part) for item in value.items() for part in item)
                return name_of("collections", "OrderedDict") + b")R(" + items + b"u"
        return pickle.dumps(value, protocol=2)[2:-1]

    def tensor(self, tensor: Tensor) -> bytes:
        """Opcodes of a tensor over a storage of its own."""
        key = str(len(self.storages))
        self.storages.append(tensor.storage.tobytes())
        self.counts.append(len(tensor.storage))
        note = ("storage", name_of("torch", tensor.kind), key, "cpu", len(tensor.storage))
        storage = self.value((*note, None) if self.stream else note) + b"Q"
        hooks = name_of("collections", "OrderedDict") + b")R"
        parts = (storage, tensor.offset, tensor.size, tensor.stride, False, hooks)
        code = name_of("torch._utils", "_rebuild_tensor_v2") + self.value(parts) + b"R"
        if not tensor.parameter:
            return code
        return name_of("torch._utils", "_rebuild_parameter") + self.value((code, True, hooks)) + b"R"


def write_archive(path: Path, value: Any, *, byteorder: str = "little", compression: int = zipfile.ZIP_STORED) -> None:
    """The zip format; arrays of big-endian files must be swapped by the caller."""
    writer = Writer()
    content = b"\x80\x02" + writer.value(value) + b"."
    with zipfile.ZipFile(path, "w", compression) as archive:
        archive.writestr("archive/data.pkl", content)
        archive.writestr("archive/byteorder", byteorder)
        for index, numbers in enumerate(writer.storages):
            archive.writestr(f"archive/data/{index}", numbers)
        archive.writestr("archive/version", "3\n")


def write_stream(path: Path, value: Any) -> None:
    """The format before torch 1.6."""
    writer = Writer(stream=True)
    content = b"\x80\x02" + writer.value(value) + b"."
    machine = {"protocol_version": 1001, "little_endian": True, "type_sizes": {"short": 2, "int": 4, "long": 4}}
    head = [pickle.dumps(part, protocol=2) for part in (0x1950A86A20F9469CFC6C, 1001, machine)]
    keys = pickle.dumps([str(index) for index in range(len(writer.storages))], protocol=2)
    tail = [struct.pack("<q", n) + b for n, b in zip(writer.counts, writer.storages, strict=True)]
    path.write_bytes(b"".join([*head, content, keys, *tail]))
