"""The description of a data set as one HTML file without script and without any reference to the outside."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass

from aerojax.view.dataset.tables import Table, html_table
from aerojax.view.templates import fill, read_template


@dataclass(frozen=True)
class Figure:
    """A picture (SVG text or PNG bytes) under a file name without suffix, and what it shows."""

    file: str
    caption: str
    picture: str | bytes


@dataclass(frozen=True)
class Section:
    """Figures that belong together."""

    title: str
    note: str
    figures: tuple[Figure, ...]


def dataset_page(title: str, lead: str, tables: Sequence[Table], sections: Sequence[Section]) -> str:
    """The whole page.

    Args:
        title: of the page. lead: a sentence below it.
        tables, sections: in the order in which they appear.
    """
    body = "".join(html_table(table) for table in tables) + "".join(_section(section) for section in sections)
    parts = {
        "title": html.escape(title),
        "style": read_template("report/style.css") + read_template("dataset/style.css"),
        "lead": html.escape(lead),
        "body": body,
    }
    return fill(read_template("dataset/page.html"), parts)


def _section(section: Section) -> str:
    figures = "".join(_figure(figure) for figure in section.figures)
    note = f'<p class="quiet">{html.escape(section.note)}</p>' if section.note else ""
    title = html.escape(section.title)
    return f'<section class="card"><h2>{title}</h2>{note}<div class="grid">{figures}</div></section>'


def _figure(figure: Figure) -> str:
    caption = html.escape(figure.caption)
    if isinstance(figure.picture, bytes):
        data = base64.b64encode(figure.picture).decode()
        picture = f'<img class="heat" alt="{caption}" src="data:image/png;base64,{data}">'
    else:
        picture = figure.picture
    return f"<figure>{picture}<figcaption>{caption}</figcaption></figure>"
