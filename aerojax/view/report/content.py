"""One classified capture as one HTML file that needs no network."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8

from aerojax.view.encode import cloud_radius, jpegs_within, mask_box, mask_outline, pack_cloud
from aerojax.view.report.page import assemble
from aerojax.view.svg import curves, height_curve, top_view

IMAGE_BYTES = 2_000_000
"""Share of the images, so that the page stays below 4 MB together with the clouds and the outlines."""
CLOUD_BYTES = 900_000
OUTLINE_BYTES = 500_000
MOST_IMAGES = 1_000
"""Noise, the worst case, takes 2 kB at the smallest JPEG level, so this many fill `IMAGE_BYTES`."""
MOST_FRAMES = 600
"""More positions than a slider of a page's width can tell apart; longer captures are thinned evenly."""
MOST_POINTS = 3_000
_BYTES_PER_POINT = 12  # 3 × int16 + 3 × uint8 in base64


Number = int | float


@dataclass(frozen=True, eq=False)
class CameraCrop:
    """What one camera saw of the object.

    camera: its name.
    rgb: sRGB pixels of the crop.
    mask: the object in the crop.
    box: x0 y0 x1 y1 of the crop in full-image pixels, ends exclusive; may be scaled to `rgb`.
    full_size: width and height of the full image in pixels.
    """

    camera: str
    rgb: UInt8[np.ndarray, "height width 3"]
    mask: Bool[np.ndarray, "height width"]
    box: tuple[Number, Number, Number, Number]
    full_size: tuple[int, int]


@dataclass(frozen=True, eq=False)
class FrameReport:
    """One frame that was used.

    frame: index in the capture.
    crops: one a camera that saw the object.
    points: the reconstructed cloud, metres, world frame. colours: its sRGB colours.
    probabilities: of the classes after this frame, in the order of the report's.
    position: the object's place, metres, world frame; NaN where unknown.
    """

    frame: int
    crops: tuple[CameraCrop, ...]
    points: Float32[np.ndarray, "point 3"]
    colours: UInt8[np.ndarray, "point 3"]
    probabilities: Float[np.ndarray, "category"]
    position: Float[np.ndarray, "3"]


@dataclass(frozen=True, eq=False)
class ClassificationReport:
    """All that the page shows.

    title: name of the capture. label: the answer. truth: the right answer where it is known.
    probabilities: final ones, 0..1, by class name.
    frames: the frames used, ascending. dropped: reason by frame number.
    latency_ms: wall time by stage, milliseconds, in the pipeline's order.
    notes: sentences to show at the end.
    """

    title: str
    label: str
    probabilities: Mapping[str, float]
    truth: str | None
    frames: tuple[FrameReport, ...]
    dropped: Mapping[int, str]
    latency_ms: Mapping[str, float]
    notes: tuple[str, ...] = ()


def write_report(path: Path, report: ClassificationReport) -> None:
    """Write the page; folders are made, an older file of that name is replaced.

    Every text is escaped. Images and clouds are shrunk so that the file stays below 4 MB; where even that does not
    suffice the page shows every second, third … frame and says so.
    """
    shown = _evenly(report.frames)
    parts = {
        "title": html.escape(report.title),
        "verdict": _verdict(report),
        "bars": _bars(report),
        "summary": _summary(report),
        "cameras": _camera_figures(_camera_names(shown)),
        "plots": _plots(report),
        "latency": _latency_table(report.latency_ms),
        "dropped": _dropped(report),
        "notes": "".join(f"<p>{html.escape(note)}</p>" for note in (*report.notes, *_thinning(report, shown))),
        "data": _as_script(_page_data(report, shown)),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(assemble(parts), encoding="utf-8")


def _evenly(frames: tuple[FrameReport, ...]) -> tuple[FrameReport, ...]:
    images = sum(len(frame.crops) for frame in frames)
    return frames[:: max(1, math.ceil(images / MOST_IMAGES), math.ceil(len(frames) / MOST_FRAMES))]


def _plot_step(frames: Sequence[FrameReport]) -> int:
    """Every which frame the curves show: all of them up to three times as many as the player."""
    return max(1, math.ceil(len(frames) / (3 * MOST_FRAMES)))


def _thinning(report: ClassificationReport, shown: Sequence[FrameReport]) -> list[str]:
    if len(shown) == len(report.frames):
        return []
    return [f"The player shows {len(shown)} of {len(report.frames)} frames; the tables count all of them."]


def _camera_names(frames: Sequence[FrameReport]) -> list[str]:
    return list(dict.fromkeys(crop.camera for frame in frames for crop in frame.crops))


def _verdict(report: ClassificationReport) -> str:
    confidence = report.probabilities.get(report.label)
    sure = "" if confidence is None else f'<span class="sure">{100 * confidence:.1f} %</span>'
    answer = f'<p class="label">{html.escape(report.label)} {sure}</p>'
    if report.truth is None:
        return answer
    right = report.truth == report.label
    kind, mark = ("right", "✓ correct") if right else ("wrong", "✗ wrong")
    return f'{answer}<p class="truth {kind}">{mark} · truth: {html.escape(report.truth)}</p>'


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
        "cameras": str(len(_camera_names(report.frames))),
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
    plotted = report.frames[:: _plot_step(report.frames)]
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


def _page_data(report: ClassificationReport, shown: Sequence[FrameReport]) -> dict[str, Any]:
    radius = cloud_radius([frame.points for frame in shown])
    most = min(MOST_POINTS, CLOUD_BYTES // (_BYTES_PER_POINT * max(1, len(shown))))
    jpegs = iter(jpegs_within([crop.rgb for frame in shown for crop in frame.crops], IMAGE_BYTES))
    most_outline = max(200, min(4000, OUTLINE_BYTES // max(1, sum(len(frame.crops) for frame in shown))))
    step = _plot_step(report.frames)
    index = {frame.frame: i // step for i, frame in enumerate(report.frames)}
    frames = [
        {
            "frame": frame.frame,
            "index": index[frame.frame],
            "place": [round(float(v), 3) if math.isfinite(v) else None for v in frame.position],
            "probabilities": [round(float(p), 4) if math.isfinite(p) else None for p in frame.probabilities],
            "cloud": pack_cloud(frame.points, frame.colours, radius, most),
            "crops": {crop.camera: _crop_data(crop, next(jpegs), most_outline) for crop in frame.crops},
        }
        for frame in shown
    ]
    return {"radius": radius, "classes": list(report.probabilities), "cameras": _camera_names(shown), "frames": frames}


def _crop_data(crop: CameraCrop, jpeg: str, most_outline: int) -> dict[str, Any]:
    height, width = crop.mask.shape
    return {
        "jpeg": jpeg,
        "size": [width, height],
        "outline": mask_outline(crop.mask, most_outline),
        "object": mask_box(crop.mask),
        "box": [round(float(v), 1) for v in crop.box],
        "full": list(crop.full_size),
    }


def _as_script(data: dict[str, Any]) -> str:
    """JSON that is safe inside a script element: no `<` can open a tag, no line separator ends a line."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
