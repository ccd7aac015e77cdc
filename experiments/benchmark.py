"""Measure speed and memory, and print one JSON object: `python -m experiments.benchmark [section …]`."""

from __future__ import annotations

import importlib
import json
import os
import platform
import sys
import traceback
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import jax

from aerojax.core.provenance import commit
from experiments import _benchmarks

SECTIONS = sorted(path.stem for path in (Path(__file__).parent / "_benchmarks").glob("[!_]*.py"))
"""Every module in `experiments/_benchmarks` is a section: it has `measure() -> dict`."""


def measure(sections: list[str]) -> dict[str, Any]:
    """Figures by section, the machine that made them, and what is needed to make them again."""
    machine = {
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "backend": jax.default_backend(),
        "jax": jax.__version__,
        "python": platform.python_version(),
    }
    measured: dict[str, Any] = {
        "command": " ".join(["python -m experiments.benchmark", *sections]),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": commit(),
    }
    for name in sections:
        print(f"{name} …", file=sys.stderr, flush=True)
        try:
            measured[name] = importlib.import_module(f"{_benchmarks.__name__}.{name}").measure()
        except Exception as error:  # the other sections' minutes are not lost with it
            traceback.print_exc()
            measured[name] = f"failed: {error}"
    return {"machine": machine, **measured}


def main() -> None:
    """Command line: names of sections, all of them by default."""
    sections = sys.argv[1:] or SECTIONS
    unknown = sorted(set(sections) - set(SECTIONS))
    if unknown:
        print(f"error: unknown section {', '.join(unknown)}; sections are {', '.join(SECTIONS)}", file=sys.stderr)
        sys.exit(2)
    measured = measure(sections)
    print(json.dumps(measured, indent=2))
    sys.exit(any(str(part).startswith("failed: ") for part in measured.values()))


if __name__ == "__main__":
    main()
