"""USD stages written as text: one statement after the other, without the line breaks that the format wants."""

from __future__ import annotations

from pathlib import Path

TRIANGLE = (
    "int[] faceVertexCounts = [3]; int[] faceVertexIndices = [0, 1, 2]; "
    "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]; "
)
METRIC = 'upAxis = "Z"; metersPerUnit = 1; '


def write_usda(path: Path, body: str, fields: str = METRIC) -> Path:
    """Write prims under a layer's fields; statements end with `;`, and TRIANGLE stands for a mesh of one face."""
    text = f"( {fields} )\n{body}".replace("TRIANGLE", TRIANGLE)
    for old, new in (("; ", "\n"), ("{ ", "{\n"), (" }", "\n}"), ("} ", "}\n")):
        text = text.replace(old, new)
    path.write_text(f"#usda 1.0\n{text}")
    return path
