"""Files of `torch.save`, read without torch and without running anything that is stored in them.

Such a file is a pickle that names storages of numbers, beside their bytes: entries of a zip archive since torch 1.6, or
one after the other in a single stream before. A pickle may call anything that it can name; here it can name only what
tensors and dictionaries need, and those names lead to functions that note numbers and touch nothing.
"""

from __future__ import annotations

import io
import math
import pickle
import pickletools
import struct
import zipfile
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from aerojax.core.errors import UserError

ZIP_START = b"PK\x03\x04"
STREAM_MAGIC = 0x1950A86A20F9469CFC6C
"""First pickle of a stream: torch's own mark of the format."""
STREAM_START = pickle.dumps(STREAM_MAGIC, protocol=2)

_BFLOAT16 = "bfloat16"
_NUMBERS = {
    "FloatStorage": "f4",
    "DoubleStorage": "f8",
    "HalfStorage": "f2",
    "BFloat16Storage": _BFLOAT16,
    "LongStorage": "i8",
    "IntStorage": "i4",
    "ShortStorage": "i2",
    "CharStorage": "i1",
    "ByteStorage": "u1",
    "BoolStorage": "?",
}
"""Number format of each of torch's classes of storage; NumPy has no bfloat16."""

_NUMBERING = ("PUT", "BINPUT", "LONG_BINPUT")
"""Opcodes that note a part under a number: a table as long as the number is made for it."""
_SMALL_TABLE = 1 << 16
"""Parts whose table takes half a megabyte, which any file may."""

_BROKEN = (
    *(pickle.UnpicklingError, zipfile.BadZipFile, struct.error, EOFError, OSError, ImportError, RuntimeError),
    *(TypeError, AttributeError, ValueError, LookupError, OverflowError, MemoryError),
)
"""What unpickling and unpacking raise for bytes that make no sense."""


class _Storage(NamedTuple):
    """A run of `count` numbers that the file keeps under `key`."""

    key: str
    kind: str
    count: int


class _Tensor(NamedTuple):
    """A view of a storage; offset and strides count elements."""

    storage: _Storage
    offset: int
    size: tuple[int, ...]
    stride: tuple[int, ...]


_Load = Callable[[_Storage], np.ndarray]


def read_torch(path: Path) -> Any:
    """The object that was saved, with NumPy arrays for tensors.

    Arrays are read-only views and may be strided; bfloat16 becomes float32. Containers are dict, list and tuple.

    Raises:
        UserError: the file is absent, broken, of another format, or names something that tensors do not need; nothing
            of it has run then.
    """
    if not path.is_file():
        raise UserError("missing", f"{path} does not exist", "correct the path")
    try:
        with path.open("rb") as file:
            start = file.read(len(STREAM_START))
        if start.startswith(ZIP_START):
            with zipfile.ZipFile(path) as archive:
                return _read_archive(archive, path)
        if start == STREAM_START:
            return _read_stream(io.BytesIO(path.read_bytes()), path)
    except UserError:
        raise
    except _BROKEN as error:
        raise UserError(
            "unreadable", f"{path} is broken or cut off ({type(error).__name__}: {error})", "fetch it again"
        ) from None
    raise UserError("unreadable", f"{path} is not a file of torch.save", "safetensors files need no import")


def read_state_dict(path: Path) -> dict[str, np.ndarray]:
    """A file that holds names and tensors and nothing else, as `torch.save(model.state_dict(), …)` writes it.

    Raises:
        UserError: as `read_torch`; or the content is something else, which the message describes.
    """
    content = read_torch(path)
    if not isinstance(content, dict):
        raise UserError(
            "unreadable", f"{path} holds a {type(content).__name__}, not a state dict", "save model.state_dict() alone"
        )
    other_entries = [str(k) for k, v in content.items() if not (isinstance(k, str) and isinstance(v, np.ndarray))]
    if other_entries or not content:
        names = ", ".join(sorted(other_entries)[:10]) or "nothing"
        raise UserError(
            "unreadable", f"{path} is not a plain state dict, it holds {names}", "save model.state_dict() alone"
        )
    return content


class _Unpickler(pickle.Unpickler):
    """Knows the names that tensors need and refuses every other."""

    def __init__(self, file: io.BytesIO, path: Path):
        super().__init__(file, encoding="utf-8")
        self.storages: dict[str, _Storage] = {}
        self._file, self._path = file, path
        # Made anew for every file, so that a pickle which alters them alters nothing that outlives it.
        self._known = {
            ("collections", "OrderedDict"): OrderedDict,
            ("torch", "Size"): tuple,
            ("torch._utils", "_rebuild_tensor"): lambda *values: _Tensor(*values),
            ("torch._utils", "_rebuild_tensor_v2"): lambda *values: _Tensor(*values[:4]),
            ("torch._utils", "_rebuild_parameter"): lambda tensor, *_: tensor,
            **{("torch", name): name for name in _NUMBERS},
        }

    def load(self) -> Any:
        """The next object of the file.

        Raises:
            pickle.UnpicklingError: it numbers a part beyond the file's bytes, for which memory would be taken.
        """
        start, most = self._file.tell(), max(len(self._file.getbuffer()), _SMALL_TABLE)
        for code, number, _ in pickletools.genops(self._file):
            if code.name in _NUMBERING and number is not None and number > most:
                raise pickle.UnpicklingError(f"a part has the number {number} in a file that has room for {most}")
        self._file.seek(start)
        return super().load()

    def find_class(self, module: str, name: str) -> Any:
        """A permitted name's stand-in.

        Raises:
            UserError: the name is not permitted.
        """
        if (module, name) not in self._known:
            raise UserError(
                "invalid",
                f"{self._path} names {module}.{name}, which no tensor needs",
                "nothing of it was run. Only tensors of plain types in dictionaries are read: do "
                "not trust the file, or save model.state_dict() alone",
            )
        return self._known[module, name]

    def persistent_load(self, pid: Any) -> _Storage:
        """The note of a storage: ("storage", class, key, device, count), in streams with a view of another at the end.

        Raises:
            pickle.UnpicklingError: it is something else.
        """
        match pid:
            case ("storage", str(kind), str(key), str(), int(count), *view) if kind in _NUMBERS and view in (
                [],
                [None],
            ):
                return self.storages.setdefault(key, _Storage(key, kind, count))
        raise pickle.UnpicklingError(f"storage {pid!r} is of no known kind")


def _read_archive(archive: zipfile.ZipFile, path: Path) -> Any:
    names = archive.namelist()
    pickles = [name for name in names if name.count("/") == 1 and name.endswith("/data.pkl")]
    if len(pickles) != 1 or any(name.endswith("/constants.pkl") for name in names):
        raise UserError(
            "unreadable",
            f"{path} is a zip archive but no file of torch.save (TorchScript is not read)",
            "save it again",
        )
    packed = [item.filename for item in archive.infolist() if item.compress_type != zipfile.ZIP_STORED]
    if packed:
        raise UserError(
            "invalid", f"{path}: entry {packed[0]} is compressed, which torch.save never does", "save it again"
        )
    root = pickles[0].removesuffix("data.pkl")
    order = archive.read(root + "byteorder").strip() if root + "byteorder" in names else b"little"
    content = _Unpickler(io.BytesIO(archive.read(pickles[0])), path).load()
    loaded: dict[_Storage, np.ndarray] = {}

    def load(storage: _Storage) -> np.ndarray:
        if storage not in loaded:
            loaded[storage] = _numbers(archive.read(f"{root}data/{storage.key}"), storage, big=order == b"big")
        return loaded[storage]

    return _resolve(content, load, {})


def _read_stream(file: io.BytesIO, path: Path) -> Any:
    """Five pickles (mark, version, machine, content, keys of the storages), then each storage's count and numbers."""
    _, _, machine = (_Unpickler(file, path).load() for _ in range(3))
    unpickler = _Unpickler(file, path)
    content = unpickler.load()
    loaded: dict[_Storage, np.ndarray] = {}
    for key in _Unpickler(file, path).load():
        storage = unpickler.storages[key]
        (count,) = struct.unpack("<q", file.read(8))
        if count != storage.count:
            raise ValueError(f"storage {key} has {count} numbers, expected {storage.count}")
        loaded[storage] = _numbers(file.read(count * _width(storage.kind)), storage, big=not machine["little_endian"])
    return _resolve(content, loaded.__getitem__, {})


def _width(kind: str) -> int:
    return 2 if _NUMBERS[kind] == _BFLOAT16 else np.dtype(_NUMBERS[kind]).itemsize


def _numbers(content: bytes, storage: _Storage, *, big: bool) -> np.ndarray:
    if len(content) != storage.count * _width(storage.kind):
        raise ValueError(f"storage {storage.key} has {len(content)} bytes, too few or too many for {storage.count}")
    order, kind = ">" if big else "<", _NUMBERS[storage.kind]
    if kind == _BFLOAT16:  # the upper half of a float32
        return (np.frombuffer(content, order + "u2").astype(np.uint32) << 16).view(np.float32)
    return np.frombuffer(content, order + kind).astype(kind, copy=False)


_UNFINISHED = object()


def _resolve(value: Any, load: _Load, done: dict[int, Any]) -> Any:
    """Put arrays in the place of tensors; a part that is shared is resolved once, and none may hold itself."""
    if isinstance(value, _Tensor):
        return _view(value, load)
    if not isinstance(value, dict | list | tuple):
        return value
    if done.get(id(value)) is _UNFINISHED:
        raise ValueError("a container holds itself")
    if id(value) not in done:
        done[id(value)] = _UNFINISHED
        if isinstance(value, dict):
            done[id(value)] = {key: _resolve(part, load, done) for key, part in value.items()}
        else:
            parts = [_resolve(part, load, done) for part in value]
            done[id(value)] = parts if isinstance(value, list) else tuple(parts)
    return done[id(value)]


def _view(tensor: _Tensor, load: _Load) -> np.ndarray:
    """The tensor's elements where they lie in its storage, read-only."""
    storage, offset, size, stride = tensor
    integers = (offset, *size, *stride)
    if not (isinstance(storage, _Storage) and all(type(n) is int and n >= 0 for n in integers)):
        raise ValueError(f"tensor {tensor!r} makes no sense")
    elements = math.prod(size)
    last = offset + sum((n - 1) * step for n, step in zip(size, stride, strict=True)) if elements else 0
    if elements > storage.count or last >= max(storage.count, 1):
        raise ValueError(
            f"a tensor of shape {size} reaches beyond the {storage.count} numbers of storage {storage.key}"
        )
    numbers = load(storage)
    steps = [step * numbers.itemsize for step in stride]
    return np.lib.stride_tricks.as_strided(numbers[offset:], size, steps, writeable=False)
