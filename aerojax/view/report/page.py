"""One classified capture as one HTML file that needs no network."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from aerojax.core.files import write_text
from aerojax.view.report.agreement import agreement_table
from aerojax.view.report.content import ClassificationReport, FrameReport
from aerojax.view.report.player import MOST_FRAMES, as_script, camera_names, player_data, plot_step, shown_frames
from aerojax.view.svg import curves, height_curve, top_view
from aerojax.view.templates import fill, read_template


def write_report(path: Path, report: ClassificationReport) -> None:
    """Write the page; folders are made, an older file of that name is replaced.

    Every text is escaped. Images and clouds are shrunk so that the file stays below 4 MB; where even that does not
    suffice the page shows every second, third … frame and says so.
    """
    shown = shown_frames(report.frames)
    parts = {
        "style": read_template("report/style.css"),
        "script": read_template("report/script.js"),
        "title": html.escape(report.title),
        "verdict": _verdict(report),
        "bars": _bars(report),
        "summary": _summary(report),
        "cameras": _camera_figures(camera_names(shown)),
        "plots": _plots(report),
        "latency": _latency_table(report.latency_ms),
        "dropped": _dropped(report),
        "agreement": agreement_table(report.agreement),
        "notes": "".join(f"<p>{html.escape(note)}</p>" for note in (*report.notes, *_thinning(report, shown))),
        "data": as_script(player_data(report, shown)),
    }
    write_text(path, fill(read_template("report/page.html"), parts))


def _thinning(report: ClassificationReport, shown: Sequence[FrameReport]) -> list[str]:
    if len(shown) == len(report.frames):
        return []
    return [f"The player shows {len(shown)} of {len(report.frames)} frames; the tables count all of them."]


def _verdict(report: ClassificationReport) -> str:
    confidence = report.probabilities.get(report.label)
    sure = "" if confidence is None else f'<span class="sure">{100 * confidence:.1f} %</span>'
    answer = f'<p class="label">{html.escape(report.label)} {sure}</p>' if report.sure else _not_sure(report, sure)
    if report.truth is None:
        return answer
    right = report.truth == report.label
    kind, mark = ("right", "✓ correct") if right else ("wrong", "✗ wrong")
    return f'{answer}<p class="truth {kind}">{mark} · truth: {html.escape(report.truth)}</p>'


def _not_sure(report: ClassificationReport, sure: str) -> str:
    reasons = "".join(f"<li>{html.escape(reason)}</li>" for reason in report.reasons)
    likely = f'<p class="quiet">most likely {html.escape(report.label)} {sure}</p>'
    return f'<p class="label">not sure</p>{likely}<ul class="doubts">{reasons}</ul>'


def _bars(report: ClassificationReport) -> str:
    rows = []
    for index, (name, value) in enumerate(report.probabilities.items()):
        bar = (
            f'<div class="bar"><div class="fill f{index}" style="width:{100 * min(max(value, 0), 1):.2f}%"></div></div>'
        )
        rows.append(
            f'<tr><th scope="row">{html.escape(name)}</th><td>{bar}</td><td class="number">{value:.4f}</td></tr>'
        )
    return f'<table class="bars"><caption>Probabilities</caption><tbody>{"".join(rows)}</tbody></table>'


def _summary(report: ClassificationReport) -> str:
    facts = {
        "frames used": str(len(report.frames)),
        "frames dropped": str(len(report.dropped)),
        "cameras": str(len(camera_names(report.frames))),
        "latency": f"{sum(report.latency_ms.values()):.1f} ms",
    }
    return "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in facts.items())


def _camera_figures(names: Sequence[str]) -> str:
    overlay = '<svg class="over"><path class="outline"/><rect class="box"/></svg><svg class="place"><rect/></svg>'
    return "".join(
        f'<figure class="camera"><div class="picture"><img alt="{html.escape(name)}">{overlay}</div>'
        f'<figcaption><b>{html.escape(name)}</b> <span class="where"></span></figcaption></figure>'
        for name in names
    )


def _plots(report: ClassificationReport) -> str:
    if not report.frames:
        return '<p class="quiet">No frame was usable.</p>'
    plotted = report.frames[:: plot_step(report.frames)]
    frames = [frame.frame for frame in plotted]
    table = np.stack([frame.probabilities for frame in plotted])
    names = list(report.probabilities)
    series = {name: table[:, index].tolist() for index, name in enumerate(names)}
    legend = "".join(f'<li><i class="f{i}"></i>{html.escape(name)}</li>' for i, name in enumerate(names))
    positions = np.stack([frame.position for frame in plotted]).astype(np.float64)
    cards = {
        "Probability so far": curves("probability over the frames", frames, series, "probability")
        + f'<ul class="legend">{legend}</ul>',
        "Track from above": top_view(positions),
        "Height": height_curve(frames, positions[:, 2].tolist()),
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
    return f'<table class="bars"><tbody>{rows}</tbody><tfoot>{foot}</tfoot></table>'


def _dropped(report: ClassificationReport) -> str:
    used = {frame.frame for frame in report.frames}
    numbers = sorted(used | set(report.dropped))
    strip = "".join(
        f'<i class="{"used" if frame in used else "lost"}" title="frame {frame}"></i>'
        for frame in (numbers if len(numbers) <= MOST_FRAMES else ())
    )
    reasons: dict[str, list[int]] = {}
    for frame, reason in sorted(report.dropped.items()):
        reasons.setdefault(reason, []).append(frame)
    rows = "".join(
        f'<tr><th scope="row">{html.escape(reason)}</th><td>{", ".join(map(str, frames))}</td></tr>'
        for reason, frames in reasons.items()
    )
    table = (
        f'<table class="reasons"><tbody>{rows}</tbody></table>' if rows else '<p class="quiet">None was dropped.</p>'
    )
    return f'<div class="strip">{strip}</div>{table}'
