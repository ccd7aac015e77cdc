"""A description of data sets as files: JSON, Markdown, one page, and its figures."""

from __future__ import annotations

from pathlib import Path

from aerojax.core.files import write_bytes, write_json, write_text
from aerojax.evaluate.dataset_qa.description import Description, to_json
from aerojax.view.dataset.figures import sections_of
from aerojax.view.dataset.page import dataset_page
from aerojax.view.dataset.plots import standalone
from aerojax.view.dataset.summary import summary, tables_of
from aerojax.view.dataset.tables import markdown


def write_description(found: Description, folder: Path) -> Path:
    """Write description.json, description.md, description.html and figures/; return the page's path."""
    tables, sections = tables_of(found), sections_of(found)
    title, page = f"Data set {', '.join(found.folders)}", folder / "description.html"
    write_json(folder / "description.json", to_json(found))
    write_text(folder / "description.md", markdown(tables, title=title))
    write_text(page, dataset_page(title, summary(found), tables, sections))
    for figure in (figure for section in sections for figure in section.figures):
        path, picture = folder / "figures" / figure.file, figure.picture
        if isinstance(picture, bytes):
            write_bytes(path.with_name(f"{path.name}.png"), picture)
        else:
            write_text(path.with_name(f"{path.name}.svg"), standalone(picture))
    return page
