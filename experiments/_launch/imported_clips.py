"""How acts that import clips end: a file of figures, a line, and the names of what was unreadable."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.data.imports.each_clip import ImportedClips
from experiments._launch.command import Run


def tell(made: ImportedClips, folder: Path, run: Run, *, what: str) -> None:
    """Write metrics.json and print how many clips there are.

    Args:
        made: what the import left.
        folder: of the clips.
        run: whose directory the figures go to.
        what: the sources, in the plural.

    Raises:
        UserError: some left no clip; names every one of them.
    """
    results = {"folder": str(folder), "clips": made.counts, "problems": list(made.problems)}
    write_json(run.directory / "metrics.json", results)
    Console().print(f"{folder}: {made.counts}", soft_wrap=True)
    if made.problems:
        raise UserError("invalid", f"some {what} left no clip:\n  " + "\n  ".join(made.problems), "mend the files")
