"""One classified capture as one HTML file that needs no network."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from aerojax.core.files import write_text
from aerojax.view.report.agreement import agreement_table
from aerojax.view.report.content import ClassificationReport
from aerojax.view.report.explanation import explanation_cards
from aerojax.view.report.findings import findings
from aerojax.view.report.pictures import player_section
from aerojax.view.report.player import Step, as_script, player_data, plot_step, shown_steps, steps_of
from aerojax.view.report.verdict import bars, verdict
from aerojax.view.svg import height_curve, top_view
from aerojax.view.templates import fill, policy_hash, read_template
from aerojax.view.viewer.scene import viewer_script


def write_report(path: Path, report: ClassificationReport) -> None:
    """Write the page; folders are made, an older file of that name is replaced.

    Every text is escaped. Images and Gaussians are thinned so that the file stays below 4 MB; where even that does not
    suffice the page shows every second, third … frame and says so.
    """
    steps = steps_of(report)
    shown = shown_steps(steps)
    data = player_data(report, shown)
    script = "\n".join(["(() => {", '"use strict";', viewer_script(), read_template("report/script.js"), "})();"])
    notes = (*report.notes, *_thinning(steps, shown))
    parts = {
        "style": read_template("report/style.css"),
        "script": script,
        "hash": policy_hash(script),
        "title": html.escape(report.title),
        "verdict": verdict(report),
        "bars": bars(report),
        "findings": findings(report),
        "player": player_section(report, shown, data),
        "plots": _plots(report),
        "latency": _latency_table(report.latency_ms),
        "agreement": agreement_table(report.agreement),
        "notes": "".join(f"<p>{html.escape(note)}</p>" for note in notes),
        "made_by": _entries(report.made_by),
        "data": as_script(data),
    }
    write_text(path, fill(read_template("report/page.html"), parts))


def _entries(facts: Mapping[str, str]) -> str:
    return "".join(f"<div><dt>{html.escape(k)}</dt><dd>{html.escape(v)}</dd></div>" for k, v in facts.items())


def _thinning(steps: Sequence[Step], shown: Sequence[Step]) -> list[str]:
    if len(shown) == len(steps):
        return []
    return [f"The player shows {len(shown)} of {len(steps)} frames; the tables count all of them."]


def _plots(report: ClassificationReport) -> str:
    if not report.frames:
        return ""
    plotted = report.frames[:: plot_step(report.frames)]
    positions = np.stack([frame.position for frame in plotted]).astype(np.float64)
    cards = {
        "Track from above": top_view(positions),
        "Height": height_curve([frame.frame for frame in plotted], positions[:, 2].tolist()),
        **explanation_cards(report),
    }
    return "".join(f'<section class="card"><h2>{name}</h2>{body}</section>' for name, body in cards.items())


def _latency_table(latency_ms: Mapping[str, float]) -> str:
    total = sum(latency_ms.values())
    longest = max(latency_ms.values(), default=0.0) or 1.0
    rows = "".join(
        f'<tr><th scope="row">{html.escape(stage)}</th><td><div class="bar"><div class="fill"'
        f' style="width:{100 * max(value, 0) / longest:.2f}%"></div></div></td><td class="number">{value:.2f}</td></tr>'
        for stage, value in latency_ms.items()
    )
    foot = f'<tr><th scope="row">total</th><td></td><td class="number">{total:.2f}</td></tr>'
    caption = '<p class="quiet">Median milliseconds a frame.</p>'
    return f'<table class="bars"><tbody>{rows}</tbody><tfoot>{foot}</tfoot></table>{caption}'
