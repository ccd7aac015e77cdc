"""Tables as text and on a page."""

from __future__ import annotations

from aerojax.view.dataset.tables import Table, html_table, markdown


def test_tables_as_text_and_page():
    table = Table("T", "n", ("a", "b"), (("1", "<x|y>"),))
    assert "| 1 | <x\\|y> |" in markdown([table], title="all")
    assert "<td>&lt;x|y&gt;</td>" in html_table(table)
