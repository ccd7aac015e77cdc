"""What is written of acts that were killed, and read again by a call that goes on."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from aerojax.core.seeds import seed_of


def earlier_rows(path: Path, acts: Collection[str], seed: int) -> dict[str, dict[str, Any]]:
    """Rows without failures of a call that was stopped: of these acts, and of this seed."""
    if not path.is_file():
        return {}
    found = json.loads(path.read_text(encoding="utf-8"))
    good = [row for row in found["acts"] if not row["failures"] and row["act"] in acts]
    good = [row for row in good if row["seed"] == seed_of("kills", seed, row["act"])]
    return {row["act"]: {"commit": found["commit"], **row} for row in good}


def summary(rows: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Sums, and a row an act; JSON-ready."""
    sums: dict[str, Any] = {name: sum(row[name] for row in rows.values()) for name in ("kills", "byte_equal")}
    sums["failures"] = sum(len(row["failures"]) for row in rows.values())
    return {**sums, "acts": list(rows.values())}
