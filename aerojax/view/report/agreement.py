"""The table of how well the cameras agree."""

from __future__ import annotations

import html
from collections.abc import Sequence

from aerojax.view.report.content import CameraAgreement

_HEAD = ("camera", "outline off", "ray off", "uncovered")


def agreement_table(cameras: Sequence[CameraAgreement]) -> str:
    """One row a camera, the one that is wrong first and marked; a sentence where nothing is known."""
    if not cameras:
        return '<p class="quiet">Not measured.</p>'
    head = "".join(f'<th scope="col">{name}</th>' for name in _HEAD)
    rows = "".join(_row(one) for one in sorted(cameras, key=lambda one: not one.suspect))
    note = (
        "Medians over the frames. Outline: the mask against that of the shape all cameras agree on; ray: that through "
        "the mask's middle; uncovered: share of the mask outside the shape."
    )
    table = f'<table class="agreement"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>'
    return f'{table}<p class="quiet">{note}</p>'


def _row(one: CameraAgreement) -> str:
    mark = ' <span class="wrong">disagrees</span>' if one.suspect else ""
    uncovered = "–" if one.uncovered is None else f"{100 * one.uncovered:.0f} %"
    cells = (_off(one.shift_px, one.shift_m), _off(one.ray_px, one.ray_m), uncovered)
    return f'<tr><th scope="row">{html.escape(one.camera)}{mark}</th>' + "".join(map(_cell, cells)) + "</tr>"


def _cell(text: str) -> str:
    return f'<td class="number">{text}</td>'


def _off(pixels: float | None, metres: float | None) -> str:
    return "–" if pixels is None or metres is None else f"{pixels:.1f} px, {metres:.3f} m"
