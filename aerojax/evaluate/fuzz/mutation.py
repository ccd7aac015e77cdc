"""Files that are almost right: mutations that know the structure of what they change.

A mutation of random bytes is mostly refused by the first check of a reader. These keep lengths, checksums and nesting
right and change what stands inside, so that later checks are reached; a share of them damages bytes all the same.
Everything follows from the generator that is passed, so that a case can be repeated.
"""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
import zlib
from typing import Any

import numpy as np

ODD_NUMBERS = (0, -1, 1, 2, 255, 256, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**53, 2**63, 10**30, 0.5, -0.0, 1e-320)
ODD_NUMBERS += (1e308, float("inf"), float("-inf"), float("nan"))
ODD_TEXTS = (
    "",
    " ",
    "..",
    "../../outside",
    "/etc/passwd",
    "file:///etc/passwd",
    "C:\\x",
    "~",
    "a" * 300,
    "\0",
    "\u202e",
)
ODD_TEXTS += (
    "{frame}",
    "{frame:09d}",
    "{frame:0999d}",
    "{frame.__class__}",
    "%s",
    "<script>alert(1)</script>",
    "左",
    "é",
)
ODD_TEXTS += ("\ud800", "1e999", "none", "true", "data:application/octet-stream;base64,AAAA", "http://localhost:9/x")
ODD_LINES = (
    "end_header",
    "comment end_header",
    "element vertex 999999999",
    "element face 1",
    "property list uchar int v",
)
ODD_LINES += ("usemtl ../x", "mtllib ../../x.mtl", "f 1 2 9999999", "f -1 -2 -3", "v nan nan nan", "f 1/1/1 2//2 3/3")
ODD_LINES += (
    "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]",
    "<<: *a",
    "!!python/object/apply:os.system [id]",
    "}",
    "{",
)
ODD_LINES += ("prepend references = @../../x.usda@", "int[] faceVertexCounts = [99999]", "def Mesh {", "(", "-", "\t")
ODD_INTEGERS = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
DEEP = 20_000
"""Nesting beyond any parser's recursion."""
_NUMBER = re.compile(rb"-?\d+(\.\d+)?([eE][-+]?\d+)?")


def mutate_file(name: str, content: bytes, rng: np.random.Generator) -> bytes:
    """A changed copy of a file; its name's end says what structure it has."""
    suffix = name.rpartition(".")[2].lower()
    by_structure = {
        "json": mutate_json,
        "gltf": mutate_json,
        "ply": mutate_ply,
        "glb": mutate_glb,
        "safetensors": mutate_safetensors,
        "pt": mutate_zip,
        "npz": mutate_zip,
        "usdz": mutate_zip,
        "png": mutate_png,
        **dict.fromkeys(("yaml", "usda", "obj", "mtl"), mutate_text),
    }
    change = by_structure.get(suffix, mutate_bytes)
    for _ in range(int(rng.integers(1, 4))):
        content = (change if rng.random() < 0.8 else mutate_bytes)(content, rng)
    return content


def mutate_bytes(content: bytes, rng: np.random.Generator) -> bytes:
    """Flip bits, overwrite integers, cut, repeat or insert pieces."""
    if not content:
        return bytes(rng.integers(0, 256, int(rng.integers(0, 9)), dtype=np.uint8))
    data, place = bytearray(content), int(rng.integers(len(content)))
    end = min(len(data), place + int(rng.integers(1, 65)))
    match int(rng.integers(7)):
        case 0:
            data[place] ^= 1 << int(rng.integers(8))
        case 1:
            data[place] = int(rng.choice(ODD_INTEGERS)) & 0xFF
        case 2:
            value, order = int(rng.choice(ODD_INTEGERS)), "<>"[int(rng.integers(2))]
            data[place : place + 4] = struct.pack(order + "I", value)
        case 3:
            del data[place:]
        case 4:
            del data[place:end]
        case 5:
            data[place:place] = data[place:end]
        case _:
            data[place:end] = rng.integers(0, 256, end - place, dtype=np.uint8).tobytes()
    return bytes(data)


def mutate_text(content: bytes, rng: np.random.Generator) -> bytes:
    """Change a number, or swap, drop, repeat or insert lines and words."""
    numbers = list(_NUMBER.finditer(content))
    if numbers and rng.random() < 0.5:
        found = numbers[int(rng.integers(len(numbers)))]
        return content[: found.start()] + str(_odd(ODD_NUMBERS, rng)).encode() + content[found.end() :]
    by = b"\n" if rng.random() < 0.6 else b" "
    parts = content.split(by)
    here, there = (int(rng.integers(len(parts))) for _ in range(2))
    match int(rng.integers(6)):
        case 0:
            del parts[here]
        case 1:
            parts.insert(there, parts[here])
        case 2:
            parts[here], parts[there] = parts[there], parts[here]
        case 3:
            parts.insert(here, str(_odd(ODD_LINES, rng)).encode())
        case 4:
            parts[here] = str(_odd(ODD_TEXTS, rng)).encode("utf-8", "surrogatepass")
        case _:
            parts[here] = mutate_bytes(parts[here], rng)
    return by.join(parts)


def mutate_json(content: bytes, rng: np.random.Generator) -> bytes:
    """Change one node of the tree: another value, another type, gone, twice, or nested without end."""
    try:
        tree = json.loads(content)
    except (ValueError, RecursionError):
        return mutate_text(content, rng)
    if rng.random() < 0.01:
        return b"[" * DEEP + b"]" * DEEP
    changed = json.dumps(_changed(tree, rng)).encode()
    return b"\xef\xbb\xbf" + changed if rng.random() < 0.02 else changed


def _changed(node: Any, rng: np.random.Generator) -> Any:
    """A copy of a tree in which one node is another; the way down is drawn step by step."""
    inner = isinstance(node, dict | list) and len(node) > 0
    if not inner or rng.random() < 0.15:
        return _replaced(node, rng)
    keys = list(node) if isinstance(node, dict) else range(len(node))
    key = keys[int(rng.integers(len(keys)))]
    copy = dict(node) if isinstance(node, dict) else list(node)
    match int(rng.integers(12)):
        case 0:
            del copy[key]
        case 1:
            if isinstance(copy, dict):
                copy[str(_odd(ODD_TEXTS, rng))] = copy[key]
            else:
                copy.insert(key, copy[key])
        case 2:
            copy[key] = copy[keys[int(rng.integers(len(keys)))]]
        case _:
            copy[key] = _changed(node[key], rng)
    return copy


def _replaced(node: Any, rng: np.random.Generator) -> Any:
    options: list[Any] = [None, True, [], {}, [node], {"x": node}, _odd(ODD_NUMBERS, rng), _odd(ODD_TEXTS, rng)]
    if isinstance(node, int | float) and not isinstance(node, bool) and rng.random() < 0.6:
        return [node + 1, -node, node * 1e6, node + 0.25, _odd(ODD_NUMBERS, rng)][int(rng.integers(5))]
    if isinstance(node, str) and rng.random() < 0.6:
        return [node + "x", node[:-1], node.upper(), _odd(ODD_TEXTS, rng)][int(rng.integers(4))]
    return options[int(rng.integers(len(options)))]


def mutate_ply(content: bytes, rng: np.random.Generator) -> bytes:
    """Change the header's lines and leave the data, or the other way round."""
    head, mark, body = content.partition(b"end_header\n")
    if not mark or rng.random() < 0.3:
        return head + mark + mutate_bytes(body, rng)
    return mutate_text(head, rng) + mark + body


def mutate_glb(content: bytes, rng: np.random.Generator) -> bytes:
    """Change the JSON chunk and make the lengths fit again."""
    if len(content) < 20:
        return mutate_bytes(content, rng)
    (size,) = struct.unpack_from("<I", content, 12)
    text = mutate_json(content[20 : 20 + size].rstrip(b" "), rng)
    text += b" " * (-len(text) % 4)
    rest = content[20 + size :]
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + rest


def mutate_safetensors(content: bytes, rng: np.random.Generator) -> bytes:
    """Change the header, or the JSON text that an entry of its metadata is, and make its length fit again."""
    if len(content) < 8:
        return mutate_bytes(content, rng)
    (size,) = struct.unpack_from("<Q", content)
    head, body = content[8 : 8 + size], content[8 + size :]
    try:
        tree = json.loads(head)
        entries = tree.get("__metadata__", {})
        texts = [key for key, value in entries.items() if isinstance(value, str)] if isinstance(entries, dict) else []
        if texts and rng.random() < 0.6:
            key = texts[int(rng.integers(len(texts)))]
            entries[key] = mutate_json(entries[key].encode(), rng).decode("utf-8", "replace")
            head = json.dumps(tree).encode()
        else:
            head = mutate_json(head, rng)
    except (ValueError, AttributeError, RecursionError):
        head = mutate_text(head, rng)
    if rng.random() < 0.2:
        body = mutate_bytes(body, rng)
    return struct.pack("<Q", len(head)) + head + body


def mutate_zip(content: bytes, rng: np.random.Generator) -> bytes:
    """Change an entry, its name, or how many there are, and write the archive anew with right checksums."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = [(name, archive.read(name)) for name in archive.namelist()]
    except (zipfile.BadZipFile, OSError, ValueError, RuntimeError, NotImplementedError, zlib.error, EOFError):
        return mutate_bytes(content, rng)
    if not entries:
        return mutate_bytes(content, rng)
    place = int(rng.integers(len(entries)))
    name, data = entries[place]
    match int(rng.integers(8)):
        case 0:
            del entries[place]
        case 1:
            entries[place] = (str(_odd(ODD_TEXTS, rng)).encode("ascii", "replace").decode() or "x", data)
        case 2:
            entries.append((name + "2", data))
        case _:
            entries[place] = (name, mutate_bytes(data, rng))
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w") as archive:
        for each, data in entries:
            archive.writestr(zipfile.ZipInfo(each), data)
    return written.getvalue()


def mutate_png(content: bytes, rng: np.random.Generator) -> bytes:
    """Change one chunk and write its length and checksum anew."""
    chunks, place = [], 8
    while place + 12 <= len(content):
        (size,) = struct.unpack_from(">I", content, place)
        if place + 12 + size > len(content):
            break
        chunks.append((content[place + 4 : place + 8], content[place + 8 : place + 8 + size]))
        place += 12 + size
    if not chunks:
        return mutate_bytes(content, rng)
    here = int(rng.integers(len(chunks)))
    kind, data = chunks[here]
    match int(rng.integers(5)):
        case 0:
            del chunks[here]
        case 1:
            chunks.insert(here, (kind, data))
        case 2 if kind == b"IHDR":
            field = 4 * int(rng.integers(2))
            chunks[here] = (kind, data[:field] + struct.pack(">I", int(rng.choice(ODD_INTEGERS))) + data[field + 4 :])
        case _:
            chunks[here] = (kind, mutate_bytes(data, rng))
    parts = [struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks]
    return content[:8] + b"".join(parts)


def _odd(options: tuple[Any, ...], rng: np.random.Generator) -> Any:
    return options[int(rng.integers(len(options)))]
