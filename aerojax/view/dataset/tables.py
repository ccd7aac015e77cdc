"""Tables of a data set's description, as Markdown and as HTML."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """A title, what to know about the table, the names of the columns, and rows of texts."""

    title: str
    note: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def number(value: float | None, digits: int = 3) -> str:
    """A number with so many digits behind the point; a dash where there is none."""
    return "–" if value is None or math.isnan(value) else f"{value:.{digits}f}"


def markdown(tables: Sequence[Table], *, title: str) -> str:
    """A Markdown document of tables."""
    parts = [f"# {title}\n"]
    for table in tables:
        rows = [table.header, tuple("---" for _ in table.header), *table.rows]
        lines = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)
        parts.append(f"## {table.title}\n\n{table.note}\n\n{lines}\n")
    return "\n".join(parts)


def html_table(table: Table) -> str:
    """A table as a section of a page."""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in table.header)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    note = f'<p class="quiet">{html.escape(table.note)}</p>' if table.note else ""
    scroll = f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
    return f'<section class="card"><h2>{html.escape(table.title)}</h2>{note}{scroll}</section>'
