"""Damaged copies of files: bytes, numbers and words changed, parts cut, doubled or left out."""

from __future__ import annotations

import json
import random
import re
import struct
from typing import Any

ODD_NUMBERS = ("0", "-1", "1e39", "nan", "inf", "-0", "4294967296", "1e-40", "99999999999999999999", "0.5", "x", "")
ODD_VALUES = (None, -1, 0, 1, 2**31, 10**15, 0.5, 1e300, "x", "", [], {}, [-1], [0, 0, 0], True)


def mutated_text(data: bytes, rng: random.Random) -> bytes:
    """A text file with a few numbers, words, lines or bytes changed."""
    for _ in range(rng.randint(1, 3)):
        data = rng.choice((_number, _line, _word, mutated_bytes))(data, rng)
    return data


def mutated_bytes(data: bytes, rng: random.Random) -> bytes:
    """With a byte changed, a piece cut out or doubled, or the end missing."""
    if not data:
        return data
    at, length = rng.randrange(len(data)), rng.choice((1, 1, 4, 16, len(data)))
    piece = data[at : at + length]
    changed = {
        "set": bytes([rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))]),
        "cut": b"",
        "double": piece + piece,
    }[rng.choice(("set", "cut", "double"))]
    return data[:at] + changed + data[at + (1 if len(changed) == 1 else length) :]


def _number(data: bytes, rng: random.Random) -> bytes:
    found = list(re.finditer(rb"-?\d+\.?\d*", data))
    if not found:
        return data
    one = rng.choice(found)
    return data[: one.start()] + rng.choice(ODD_NUMBERS).encode() + data[one.end() :]


def _line(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    action = rng.choice(("delete", "double", "swap"))
    other = rng.randrange(len(lines))
    if action == "swap":
        lines[at], lines[other] = lines[other], lines[at]
    else:
        lines[at : at + 1] = [] if action == "delete" else [lines[at]] * rng.choice((2, 50))
    return b"\n".join(lines)


def _word(data: bytes, rng: random.Random) -> bytes:
    """One word in the place of another of the file: right words at wrong places."""
    words = list(re.finditer(rb"[A-Za-z_:]+", data))
    if len(words) < 2:
        return data
    one, other = rng.sample(words, 2)
    return data[: one.start()] + other.group() + data[one.end() :]


def mutated_glb(data: bytes, rng: random.Random) -> bytes:
    """A GLB whose JSON is valid and holds odd values, whose bytes are changed, or neither."""
    if rng.random() < 0.2:
        return mutated_bytes(data, rng)
    length = struct.unpack_from("<I", data, 12)[0]
    tree, binary = json.loads(data[20 : 20 + length]), data[28 + length :]
    for _ in range(rng.randint(1, 3)):
        if rng.random() < 0.2:
            binary = mutated_bytes(binary, rng)
        else:
            _change_tree(tree, rng)
    text = json.dumps(tree).encode()
    chunks = b"".join(struct.pack("<II", len(d), k) + d for d, k in ((text, 0x4E4F534A), (binary, 0x004E4942)))
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def _change_tree(tree: Any, rng: random.Random) -> None:
    """Replace, delete or double one value somewhere in JSON."""
    places: list[tuple[Any, Any]] = []
    waiting = [tree]
    while waiting:
        holder = waiting.pop()
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        places += [(holder, key) for key in keys]
        waiting += [holder[key] for key in keys if isinstance(holder[key], dict | list)]
    if not places:
        return
    holder, key = rng.choice(places)
    if rng.random() < 0.2:
        del holder[key]
    elif isinstance(holder, list) and rng.random() < 0.2:
        holder.append(holder[key])
    elif isinstance(holder[key], int) and rng.random() < 0.5:
        holder[key] += rng.choice((-1, 1, 2, 1000))
    else:
        other = rng.choice(places)
        holder[key] = rng.choice(
            (
                rng.choice(ODD_VALUES),
                json.loads(json.dumps(other[0][other[1]])) if other[1] in _keys(other[0]) else None,
            )
        )


def _keys(holder: Any) -> Any:
    return holder if isinstance(holder, dict) else range(len(holder))
