"""The page of a data set: every text that comes from data is escaped."""

from __future__ import annotations

import html
from html.parser import HTMLParser

from aerojax.view.dataset.page import Figure, Section, dataset_page
from aerojax.view.dataset.tables import Table

HOSTILE = "\"'><script>alert(1)</script>[[body]]"


def test_every_text_is_escaped():
    table = Table(HOSTILE, HOSTILE, (HOSTILE,), ((HOSTILE,),))
    section = Section(HOSTILE, HOSTILE, (Figure("a", HOSTILE, b"png"), Figure("b", HOSTILE, "<svg></svg>")))
    page = dataset_page(HOSTILE, HOSTILE, [table], [section])
    seen: list[str] = []

    class Reader(HTMLParser):
        def handle_starttag(self, tag, attrs):
            seen.append(tag)
            assert not any(name.startswith("on") for name, _ in attrs)

    Reader().feed(page)
    assert "script" not in seen and "<script>alert" not in page
    assert page.count(html.escape(HOSTILE)) >= 10
