"""Statements of Wavefront files, and their material libraries (MTL)."""

from __future__ import annotations

import codecs
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.beside import find_beside
from aerojax.simulate.assets.importers.scene import Material

_UP_TO_THREE = ("-o", "-s", "-t")
_OPTIONS = {
    **dict.fromkeys(("-blendu", "-blendv", "-boost", "-bm", "-cc", "-clamp", "-imfchan", "-texres", "-type"), 1),
    "-mm": 2,
    **dict.fromkeys(_UP_TO_THREE, 3),
}
"""Options of a texture statement and how many words follow each, at most (Wavefront, MTL material format, 1995)."""


@dataclass(frozen=True)
class Paint:
    """A material of a library, and what its texture's coordinates are multiplied with and moved by."""

    material: Material
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    coloured: bool = False


@dataclass
class Palette:
    """Materials by name, and the encoded pictures that they number."""

    paints: dict[str, Paint] = field(default_factory=dict)
    textures: list[bytes] = field(default_factory=list)


def statements(path: Path) -> Iterator[tuple[int, str, str]]:
    """Number, keyword and rest of every line of an OBJ or MTL file.

    A byte order mark is left out, a backslash at a line's end continues it, keywords end at any blank. Bytes that are
    no UTF-8 are kept as they are (surrogates), so that names of files in other encodings still lead to them.
    """
    data = path.read_bytes()
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = data.decode("utf-16", "replace") if wide else data.decode("utf-8-sig", "surrogateescape")
    begun, first = "", 0
    for number, line in enumerate(re.split(r"\r\n|\r|\n", text), start=1):
        first = first or number
        if line.endswith("\\"):
            begun += line[:-1] + " "
            continue
        words = (begun + line).strip().split(None, 1)
        if words:
            yield first, words[0], words[1] if len(words) > 1 else ""
        begun, first = "", 0
    if begun.strip():
        word, _, rest = begun.strip().partition(" ")
        yield first, word, rest.strip()


@contextmanager
def understood(path: Path, number: int, word: str, rest: str) -> Iterator[None]:
    """Within it, a statement that cannot be read is refused by its line.

    Raises:
        UserError: names the file, the line and the statement.
    """
    try:
        yield
    except (ValueError, IndexError, OverflowError) as error:
        if isinstance(error, UserError):
            raise
        raise UserError(
            "unreadable", f"{path}: line {number} is not understood ({f'{word} {rest}'!r})", "export it again"
        ) from error


def numbers(rest: str) -> list[float]:
    """Finite numbers of a statement, up to a comment.

    Raises:
        ValueError: a word is no finite number.
    """
    found = [float(word) for word in rest.partition("#")[0].split()]
    if not all(map(math.isfinite, found)):
        raise ValueError(rest)
    return found


def read_library(path: Path, palette: Palette) -> None:
    """Add the materials of an MTL file: Kd (linear), d or Tr, Ns or Pr, Pm and map_Kd with its options.

    Raises:
        UserError: a statement is not understood, or a picture is missing.
    """
    name = ""
    for number, word, rest in statements(path):
        with understood(path, number, word, rest):
            if word == "newmtl":
                name = rest
                palette.paints[name] = Paint(Material(name=name))
            elif name:
                palette.paints[name] = _with(palette, palette.paints[name], word, rest, path)


def _with(palette: Palette, paint: Paint, word: str, rest: str, library: Path) -> Paint:
    """The material with one more statement."""
    material = paint.material
    if word == "Kd":
        values = numbers(rest)
        red, green, blue = values if len(values) == 3 else values[:1] * 3
        return replace(paint, material=replace(material, colour=(red, green, blue)), coloured=True)
    if word in ("d", "Tr"):
        value = numbers(rest.rpartition(" ")[2])[0]
        return replace(paint, material=replace(material, opacity=value if word == "d" else 1.0 - value))
    if word == "Ns":  # Blinn's exponent n as a microfacet width sqrt(2 / (n + 2)), which is roughness squared
        roughness = float((2.0 / (max(numbers(rest)[0], 0.0) + 2.0)) ** 0.25)
        return replace(paint, material=replace(material, roughness=roughness))
    if word == "Pr":
        return replace(paint, material=replace(material, roughness=numbers(rest)[0]))
    if word == "Pm":
        return replace(paint, material=replace(material, metallic=numbers(rest)[0]))
    return _textured(palette, paint, rest, library) if word == "map_Kd" else paint


def _textured(palette: Palette, paint: Paint, rest: str, library: Path) -> Paint:
    """With a picture; a material that gives no Kd beside it shows the picture as it is."""
    options, name = _options(rest)
    texture = find_beside(library.parent, name)
    if texture is None:
        raise UserError("missing", f"{library}: map_Kd names {name}, which is missing", "keep it beside the library")
    palette.textures.append(texture.read_bytes())
    material = replace(paint.material, texture=len(palette.textures) - 1)
    if not paint.coloured:
        material = replace(material, colour=(1.0, 1.0, 1.0))
    if options.get("-clamp") == ["on"]:
        material = replace(material, wrap=("clamp", "clamp"))
    scale, offset = ([float(v) for v in options.get(o, [])] + [n] * 2 for o, n in (("-s", 1.0), ("-o", 0.0)))
    return replace(paint, material=material, scale=(scale[0], scale[1]), offset=(offset[0], offset[1]))


def _options(rest: str) -> tuple[dict[str, list[str]], str]:
    """Options before a picture's name, which may hold blanks and be quoted."""
    found: dict[str, list[str]] = {}
    while (word := rest.split(None, 1)) and word[0] in _OPTIONS and len(word) > 1:
        option, rest, values = word[0], word[1], []
        while len(values) < _OPTIONS[option] and len(parts := rest.split(None, 1)) > 1:
            if option in _UP_TO_THREE and not re.fullmatch(r"[-+]?[\d.]+(e[-+]?\d+)?", parts[0], re.IGNORECASE):
                break
            values.append(parts[0])
            rest = parts[1]
        found[option] = values
    return found, rest.strip().strip('"')
