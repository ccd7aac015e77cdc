"""One hash for every seed and id: what is drawn depends on names, never on order, workers or machines."""

from __future__ import annotations

import hashlib


def seed_of(*words: object) -> int:
    """A 63-bit seed from any printable words; the same in every process and on every machine."""
    return int.from_bytes(_digest(words), "big") >> 1


def number_of(*words: object) -> int:
    """A number of 64 bits from any printable words, independent of `seed_of`'s: seeds of sequences, ids of records."""
    return int.from_bytes(_digest(words), "little")


def _digest(words: tuple[object, ...]) -> bytes:
    """The first 8 bytes of BLAKE2b (RFC 7693) of the words joined by `/`."""
    return hashlib.blake2b("/".join(map(str, words)).encode(), digest_size=8).digest()
