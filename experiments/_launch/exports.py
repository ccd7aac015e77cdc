"""Exports of a clip with a bar."""

from __future__ import annotations

from pathlib import Path

from aerojax.capture.format import Capture
from aerojax.pipeline.exports.export import ExportName, export_clip
from aerojax.pipeline.offline import Clip
from experiments._launch.progress import progress_bar


def export_with_bar(
    capture: Capture, clip: Clip, exports: tuple[ExportName, ...], folder: Path, *, began: str
) -> dict[str, Path]:
    """Write the exports below a folder and return their paths by name; see `export_clip`."""
    if not exports:
        return {}
    with progress_bar() as bar:
        task = bar.add_task("export", total=None)
        return export_clip(
            capture,
            clip,
            exports,
            folder,
            began=began,
            progress=lambda done, total, what: bar.update(task, completed=done, total=total, description=what),
        )
