"""PLY files as named columns of numbers, whatever the columns mean (Turk 1994, "The PLY Polygon File Format").

Read are `ascii`, `binary_little_endian` and `binary_big_endian` files, with line ends of every system. The header is
taken literally: what it declares must be there, no more and no less, and everything that it says twice or that makes
no sense is refused with the number of its line.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NoReturn

import numpy as np

from aerojax.core.errors import UserError

Order = Literal["=", "<", ">"]

NUMBERS = {
    **{name: np.dtype("i1") for name in ("char", "int8")},
    **{name: np.dtype("u1") for name in ("uchar", "uint8")},
    **{name: np.dtype("i2") for name in ("short", "int16")},
    **{name: np.dtype("u2") for name in ("ushort", "uint16")},
    **{name: np.dtype("i4") for name in ("int", "int32")},
    **{name: np.dtype("u4") for name in ("uint", "uint32")},
    **{name: np.dtype("f4") for name in ("float", "float32")},
    **{name: np.dtype("f8") for name in ("double", "float64")},
}
"""PLY's names of scalar types."""
ORDERS: dict[str, Order] = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
"""NumPy's byte order of each format of file."""
_HEADER_LIMIT = 1 << 20
"""Bytes in which a header ends; a thousand properties need 30 kB."""
_COUNT = re.compile(r"\d{1,18}")


@dataclass(frozen=True)
class Property:
    """One column: a scalar of `dtype` a row, or a list of them behind its length of type `length`."""

    name: str
    dtype: np.dtype
    length: np.dtype | None = None


@dataclass(frozen=True)
class Element:
    """One table: its name, rows and columns."""

    name: str
    count: int
    properties: tuple[Property, ...]

    @property
    def lists(self) -> tuple[str, ...]:
        """Names of the columns that hold lists."""
        return tuple(p.name for p in self.properties if p.length is not None)


@dataclass(frozen=True, eq=False)
class PlyFile:
    """What a PLY file holds.

    columns: arrays by name of element and property, in the machine's byte order; columns of lists are left out.
    elements: as declared, by name.
    comments: texts of its comments, in order.
    """

    columns: dict[str, dict[str, np.ndarray]]
    elements: dict[str, Element]
    comments: tuple[str, ...]


def read_elements(path: Path) -> PlyFile:
    """Read a PLY file whole.

    Raises:
        UserError: the file is absent, is no PLY, declares something twice or without sense (with the line), or has
            fewer or more data than it declares.
    """
    if not path.is_file():
        raise UserError("missing", f"{path}: no such file", "correct the path")
    content = path.read_bytes()
    lines, start = _header(content, path)
    order, elements, comments = _declarations(lines, path)
    source = _Text(content[start:], path) if order == "=" else _Binary(content, start, order, path)
    columns = {element.name: source.rows(element) for element in elements}
    source.finish()
    return PlyFile(columns, {e.name: e for e in elements}, comments)


def _header(content: bytes, path: Path) -> tuple[list[str], int]:
    """Lines before the line `end_header`, and the place of the first byte behind it."""
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", content)
    if first:
        end = first[1]
        last = re.compile(rb"[\r\n]end_header[ \t]*" + end).search(content, 0, _HEADER_LIMIT)
        if last:
            return content[: last.start() + 1].decode("utf-8", "replace").replace("\r\n", "\n").splitlines(), last.end()
    raise UserError(
        "unreadable", f"{path}: not a PLY file (no line 'ply' … line 'end_header')", "name a Gaussian-splat PLY"
    )


def _declarations(lines: list[str], path: Path) -> tuple[Order, list[Element], tuple[str, ...]]:
    """Byte order, elements and comments."""
    order: Order | None = None
    tables: dict[str, tuple[int, dict[str, Property]]] = {}
    comments: list[str] = []
    for number, line in enumerate(lines[1:], start=2):

        def refuse(what: str, number: int = number, line: str = line) -> NoReturn:
            raise UserError(
                "unreadable", f"{path}: line {number} of the header, {line.strip()[:80]!r}: {what}", "export it again"
            )

        match line.split():
            case [] | ["obj_info", *_]:
                pass
            case ["comment", *_]:
                comments.append(line.strip().removeprefix("comment").strip())
            case ["format", name, "1.0"] if name in ORDERS and order is None:
                order = ORDERS[name]
            case ["element", name, count]:
                if name in tables:
                    refuse("the element is declared twice")
                if not _COUNT.fullmatch(count):
                    refuse(f"{count!r} is no number of rows")
                tables[name] = (int(count), {})
            case ["property", *words] if tables:
                found = _property(words)
                properties = list(tables.values())[-1][1]
                if found is None:
                    refuse(f"known types are {', '.join(NUMBERS)}")
                if found.name in properties:
                    refuse("the property is declared twice")
                properties[found.name] = found
            case _:
                refuse("not understood here")
    if order is None:
        raise UserError("unreadable", f"{path}: the header has no line 'format … 1.0'", "export it again")
    elements = [Element(name, count, tuple(found.values())) for name, (count, found) in tables.items()]
    return order, elements, tuple(comments)


def _property(words: list[str]) -> Property | None:
    match words:
        case ["list", length, kind, name] if NUMBERS.get(length, np.dtype("f4")).kind in "iu" and kind in NUMBERS:
            return Property(name, NUMBERS[kind], NUMBERS[length])
        case [kind, name] if kind in NUMBERS:
            return Property(name, NUMBERS[kind])
    return None


def _too_short(element: Element, path: Path, what: str) -> UserError:
    return UserError(
        "invalid", f"{path}: element '{element.name}' needs {what} are left", "copy it again, it is cut short"
    )


def _too_long(path: Path, what: str) -> UserError:
    return UserError(
        "invalid", f"{path}: {what} behind the last element", "the header declares too little; export it again"
    )


@dataclass
class _Binary:
    """The body of a binary file, read from `place` on."""

    content: bytes
    place: int
    order: Order
    path: Path

    def rows(self, element: Element) -> dict[str, np.ndarray]:
        """The next element's columns."""
        if element.lists:
            return self._skip(element)
        dtype = np.dtype([(p.name, p.dtype.newbyteorder(self.order)) for p in element.properties])
        size = element.count * dtype.itemsize
        if size > len(self.content) - self.place:
            raise _too_short(element, self.path, f"{size} bytes, {len(self.content) - self.place}")
        if not size:
            return {p.name: np.zeros(0, p.dtype) for p in element.properties}
        found = np.frombuffer(self.content, dtype, element.count, self.place)
        self.place += size
        return {p.name: found[p.name].astype(p.dtype) for p in element.properties}

    def _skip(self, element: Element) -> dict[str, np.ndarray]:
        """Walk over rows of unequal length; each has at least one byte, so no declared count is trusted."""
        kinds = [p.dtype.newbyteorder(self.order) for p in element.properties]
        lengths = [p.length.newbyteorder(self.order) if p.length else None for p in element.properties]
        for _ in range(element.count):
            for kind, length in zip(kinds, lengths, strict=True):
                many = 1
                if length is not None:
                    self._need(element, length.itemsize)
                    many = max(0, int(np.frombuffer(self.content, length, 1, self.place)[0]))
                    self.place += length.itemsize
                self._need(element, many * kind.itemsize)
                self.place += many * kind.itemsize
        return {}

    def _need(self, element: Element, size: int) -> None:
        if self.place + size > len(self.content):
            raise _too_short(element, self.path, f"{size} bytes more, {len(self.content) - self.place}")

    def finish(self) -> None:
        """Refuse data that nothing declares; line ends may follow."""
        rest = self.content[self.place :].strip(b"\r\n")
        if rest:
            raise _too_long(self.path, f"{len(rest)} bytes are left")


class _Text:
    """The body of an ascii file."""

    def __init__(self, body: bytes, path: Path):
        self.words, self.place, self.path = body.split(), 0, path

    def rows(self, element: Element) -> dict[str, np.ndarray]:
        """The next element's columns."""
        if element.lists:
            return self._skip(element)
        width = len(element.properties)
        size = element.count * width
        words = self._take(element, size)
        try:
            numbers = np.array([float(word) for word in words]).reshape(element.count if width else 0, width)
        except ValueError as error:
            raise UserError(
                "unreadable", f"{self.path}: element '{element.name}': {error}", "export it again"
            ) from None
        return {p.name: self._typed(numbers[:, i], p, element) for i, p in enumerate(element.properties)}

    def _typed(self, numbers: np.ndarray, wanted: Property, element: Element) -> np.ndarray:
        if wanted.dtype.kind == "f":
            with np.errstate(over="ignore"):  # what float32 cannot hold is infinite, which the reader's caller judges
                return numbers.astype(wanted.dtype)
        limits = np.iinfo(wanted.dtype)
        if not np.all((numbers >= limits.min) & (numbers <= limits.max) & (numbers == np.floor(numbers))):
            raise UserError(
                "invalid",
                f"{self.path}: property {wanted.name} of element '{element.name}' holds numbers that no "
                f"{wanted.dtype.name} is",
                "export it again",
            )
        return numbers.astype(wanted.dtype)

    def _skip(self, element: Element) -> dict[str, np.ndarray]:
        for _ in range(element.count):
            for found in element.properties:
                many = 1
                if found.length is not None:
                    (word,) = self._take(element, 1)
                    if not _COUNT.fullmatch(word.decode("ascii", "replace")):
                        raise UserError(
                            "unreadable",
                            f"{self.path}: element '{element.name}' has {word[:20]!r} for a list's length",
                            "export it again",
                        )
                    many = int(word)
                self._take(element, many)
        return {}

    def _take(self, element: Element, many: int) -> list[bytes]:
        words = self.words[self.place : self.place + many]
        if len(words) < many:
            raise _too_short(element, self.path, f"{many} numbers, {len(words)}")
        self.place += many
        return words

    def finish(self) -> None:
        """Refuse data that nothing declares."""
        if self.place < len(self.words):
            raise _too_long(self.path, f"{len(self.words) - self.place} numbers are left")
