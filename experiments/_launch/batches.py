"""Acts over many captures: each has a name of its own, and a defective one does not end the others."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from aerojax.core.errors import UserError


def find_captures(folder: Path) -> dict[str, Path]:
    """Every capture below a folder by its path from there, which is unique where its name may not be.

    Links to folders are not followed.

    Raises:
        UserError: there is none.
    """
    found = {str(p.parent.relative_to(folder)): p.parent for p in sorted(folder.rglob("capture.json"))}
    if not found:
        raise UserError(
            "missing", f"captures={folder} holds no folder with a capture.json", "name the folder above the captures"
        )
    return found


def result_folders(captures: Sequence[Path]) -> list[str]:
    """A name for the results of each capture: its folder's; the second of one name is name-2."""
    names: list[str] = []
    for name in (folder.resolve().name for folder in captures):
        options = (name, *(f"{name}-{number}" for number in range(2, len(captures) + 2)))
        names.append(next(option for option in options if option not in names))
    return names


def show_accuracy(console: Console, figures: Mapping[str, Any]) -> None:
    """How many captures of a known class are right, from `label_figures`; nothing where there are none."""
    if figures:
        right = round(figures["accuracy"] * figures["clips"])
        console.print(f"right: {right} of {figures['clips']} with a known class, by the likeliest one")


def exit_code(failed: int, done: int) -> int:
    """0 if all captures have a result, 1 if some have none, 2 if none has."""
    return 0 if not failed else 1 if done else 2


def end_batch(failed: int, done: int, what: str) -> None:
    """End the process with a line and `exit_code` if captures have no result."""
    if failed:
        print(f"{failed} of {failed + done} captures {what}", file=sys.stderr)
        sys.exit(exit_code(failed, done))
