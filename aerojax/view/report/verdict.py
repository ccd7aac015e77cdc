"""The head of the page: the answer, whether it may be believed, and the probabilities."""

from __future__ import annotations

import html

from aerojax.core.types import UNKNOWN
from aerojax.view.report.content import ClassificationReport

_STATUS = {
    "ok": ("✓", "ok", "the label may be believed"),
    "unsure": ("?", "unsure", "the label is the likeliest, no more"),
    "insufficient": ("∅", "insufficient", "too little was seen to say"),
    UNKNOWN: ("◇", "unknown", "like none of the classes"),
}
"""Mark, name and meaning of each status; never told by colour alone."""


def verdict(report: ClassificationReport) -> str:
    """The label with its probability, its status and, where it is not ok, the reasons."""
    status = UNKNOWN if report.label == UNKNOWN and report.status == "ok" else report.status
    mark, name, meaning = _STATUS[status]
    sure = _percent(report, report.label)
    label = {"ok": html.escape(report.label), UNKNOWN: "unknown"}.get(status, "not sure")
    lines = [f'<h1 class="label">{label}{sure if status == "ok" else ""}</h1>']
    lines.append(f'<p class="status {status}"><b>{mark} {name}</b> {meaning}</p>')
    if status in ("unsure", "insufficient"):
        lines.append(f'<p class="likely">most likely {html.escape(report.label)}{sure}</p>')
    if report.reasons:
        reasons = "".join(f"<li>{html.escape(reason)}</li>" for reason in report.reasons)
        lines.append(f'<ul class="doubts">{reasons}</ul>')
    if report.truth is not None:
        lines.append(_truth(report, claimed=status in ("ok", UNKNOWN)))
    return "".join(lines)


def _truth(report: ClassificationReport, *, claimed: bool) -> str:
    truth, right = html.escape(report.truth or ""), report.truth == report.label
    if not claimed:
        return f'<p class="truth">truth: {truth}</p>'
    kind, word = ("right", "✓ correct") if right else ("wrong", "✗ wrong")
    return f'<p class="truth {kind}">{word} · truth: {truth}</p>'


def _percent(report: ClassificationReport, name: str) -> str:
    value = report.probabilities.get(name)
    return "" if value is None else f' <span class="sure">{100 * value:.1f} %</span>'


def bars(report: ClassificationReport) -> str:
    """Final probabilities, one bar a class."""
    if not report.probabilities:
        return ""
    rows = []
    for index, (name, value) in enumerate(report.probabilities.items()):
        width = 100 * min(max(value, 0), 1)
        bar = f'<div class="bar"><div class="fill f{index}" style="width:{width:.2f}%"></div></div>'
        rows.append(
            f'<tr><th scope="row">{html.escape(name)}</th><td>{bar}</td><td class="number">{value:.4f}</td></tr>'
        )
    caption = "<caption>Probabilities after the last frame</caption>"
    return f'<table class="bars">{caption}<tbody>{"".join(rows)}</tbody></table>'
