"""What the reader has to know first: frames that were dropped, cameras that disagree, warnings."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from aerojax.view.report.content import CameraAgreement, ClassificationReport
from aerojax.view.report.player import Step

_GOOD, _BAD = "✓", "!"
_MOST_MARKS = 240
"""Frames of the strip beside the slider; more could not be told apart."""


def findings(report: ClassificationReport) -> str:
    """One entry a matter: short where all is well, with every reason where it is not."""
    entries = [_frames(report), *_cameras(report.agreement)]
    entries += [_entry(False, html.escape(warning)) for warning in report.warnings]
    return f'<ul class="card findings" aria-label="What to know first">{"".join(entries)}</ul>'


def frame_strip(steps: Sequence[Step]) -> str:
    """Which frames were used, as marks under the slider; a dropped one is lower and of another colour."""
    if len(steps) > _MOST_MARKS:
        return ""
    marks = "".join(f'<i class="{"used" if step.used else "lost"}"></i>' for step in steps)
    return f'<div class="strip" aria-hidden="true">{marks}</div>'


def ranges(numbers: Iterable[int]) -> str:
    """Ascending numbers in few words: 3–7, 9."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs)


def _entry(good: bool, text: str, detail: str = "") -> str:
    kind, mark = ("good", _GOOD) if good else ("bad", _BAD)
    return f'<li class="{kind}"><b aria-hidden="true">{mark}</b><div><p>{text}</p>{detail}</div></li>'


def _frames(report: ClassificationReport) -> str:
    used, dropped = len(report.frames), len(report.dropped)
    if not used:
        return _entry(False, "No frame gives a place.", _reasons(report))
    if not dropped:
        return _entry(True, f"All {used} frames were used.")
    return _entry(False, f"{dropped} of {used + dropped} frames were dropped.", _reasons(report))


def _reasons(report: ClassificationReport) -> str:
    by_reason: dict[str, list[int]] = {}
    for frame, reason in report.dropped.items():
        by_reason.setdefault(reason, []).append(frame)
    rows = (f"<li>frame{'s' * (len(f) > 1)} {ranges(f)}: {html.escape(reason)}</li>" for reason, f in by_reason.items())
    return f"<ul>{''.join(rows)}</ul>" if by_reason else ""


def _cameras(agreement: Sequence[CameraAgreement]) -> list[str]:
    entries = []
    suspects = [one for one in agreement if one.suspect]
    for one in suspects:
        by = "" if one.shift_px is None else f": its outlines are off by {one.shift_px:.1f} pixels"
        entries.append(_entry(False, f"Camera {html.escape(one.camera)} disagrees with the others{by}."))
    shifts = [one.shift_px for one in agreement if one.shift_px is not None]
    if shifts and not suspects:
        worst = max(shifts)
        within = f"outlines within {worst:.1f} pixels (median)"
        entries.append(_entry(True, f"No camera of {len(agreement)} stands out; {within}."))
    return entries
