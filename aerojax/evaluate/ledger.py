"""The claims of the thesis beside what is measured here: which figure is ours, and the rule that says who is right.

A claim is held against one field of one file of results/. What measures something else than the claim says is no
measurement of it: such claims have no field and are "not measured".
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError
from aerojax.evaluate.result_paths import NoSuchRowError, lookup

Rule = Literal["equal", "more", "less", "above", "below", "bound", "over"]
"""equal: the same quantity, equal up to `tolerance`. more, less: of our figure, more or less of which is better.
above, below: the claim is that a difference is above or below 0. bound, over: it is that a figure is not above
`figure`, or is above it."""
Verdict = Literal["reproduced", "contradicted", "beaten", "undecided", "not measured"]
"""undecided: measured, and the interval holds both answers."""
VERDICTS: dict[Verdict, str] = {
    "reproduced": "what is claimed holds here",
    "beaten": "our figure is better than the thesis' figure",
    "contradicted": "what is claimed does not hold here, or our figure is worse",
    "undecided": "measured, and the interval holds both answers",
    "not measured": "nothing in results/ measures this",
}
CLAIMS = "ledger_claims.toml"
T_95 = {2: 4.303, 4: 2.776, 6: 2.447, 8: 2.306}
"""Student's t, two-sided 95 %, by degrees of freedom: of two rows of 2, 3, 4 and 5 seeds together."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim of the thesis and where its measurement stands.

    source: table, figure or section. text: the claim in our words. thesis: its figure as people read it.
    rule: who is right, see `Rule`; without a `result` it is not used.
    figure: the thesis' figure in the unit of ours (shares 0..1). tolerance: of the rule `equal`.
    own: measured on data of our own making, where the thesis has other data; then an absolute figure is never
        "reproduced", and the sign of a difference may be.
    result: file of results/ without its end. ours: path to our figure in it, a number or `{"mean", "std"}` over seeds.
    minus: path to a figure that is subtracted from it. interval: path to the 95 % interval, low and high.
    seeds: path to the list of seeds, where a figure is a mean over them.
    shown: format of our figure; `.1%` for shares. note: what else has to be said, such as how ours differs.
    """

    source: str
    text: str
    thesis: str = ""
    rule: Rule = "above"
    figure: float = 0.0
    tolerance: float = 0.0
    own: bool = True
    result: str = ""
    ours: str = ""
    minus: str = ""
    interval: str = ""
    seeds: str = ""
    shown: str = ".1%"
    note: str = ""

    @property
    def is_difference(self) -> bool:
        """Whether our figure is a difference of two."""
        return self.rule in ("above", "below", "bound") or bool(self.minus) or ".difference" in self.ours


@dataclass(frozen=True)
class Figure:
    """Our figure; low and high are the ends of its 95 % interval, or None if it has none."""

    value: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Entry:
    """A line of the ledger: a claim, our figure or None, and the verdict."""

    claim: Claim
    figure: Figure | None
    verdict: Verdict


def read_claims() -> tuple[Claim, ...]:
    """The claims of the package, in the thesis' order.

    Raises:
        UserError: a claim has an unknown key or a value of another type.
    """
    text = (files("aerojax.evaluate") / CLAIMS).read_text(encoding="utf-8")
    return tuple(to_dataclass(row, Claim, source=CLAIMS) for row in tomllib.loads(text)["claim"])


def verdict(claim: Claim, figure: Figure | None) -> Verdict:
    """Who is right; a figure without an interval stands for itself.

    Args:
        claim: with its rule.
        figure: ours, a difference for the rules `above` and `below`; None if there is none.
    """
    if figure is None:
        return "not measured"
    low = figure.value if figure.low is None else figure.low
    high = figure.value if figure.high is None else figure.high
    if claim.rule == "equal":
        return "reproduced" if abs(figure.value - claim.figure) <= claim.tolerance else "contradicted"
    if claim.rule == "bound":
        return "reproduced" if high <= claim.figure else "contradicted" if low > claim.figure else "undecided"
    if claim.rule in ("less", "below"):
        low, high, reference = -high, -low, -claim.figure
    else:
        reference = claim.figure
    if claim.rule in ("above", "below", "over"):
        limit = reference if claim.rule == "over" else 0.0
        return "reproduced" if low > limit else "contradicted" if high <= limit else "undecided"
    if low > reference:
        return "beaten"
    if high < reference:
        return "contradicted"
    return "undecided" if claim.own else "reproduced"


def figure_of(claim: Claim, results: Path) -> Figure | None:
    """Our figure of a claim; None if it names no file, one that is not there, or a row that has not been run.

    Raises:
        UserError: the file lacks the field.
    """
    path = results / f"{claim.result}.json"
    if not claim.result or not path.is_file():
        return None
    values = json.loads(path.read_text(encoding="utf-8"))
    try:
        seeds = len(lookup(values, claim.seeds)) if claim.seeds else 1
        ours = lookup(values, claim.ours)
        theirs = lookup(values, claim.minus) if claim.minus else None
        ends = lookup(values, claim.interval) if claim.interval else None
    except NoSuchRowError:
        return None
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise UserError(
            "missing", f"{path} has no {claim.ours} ({error})", f"mend {claim.source} of {CLAIMS}"
        ) from None
    if ends is not None:
        return Figure(_mean(ours) - (0.0 if theirs is None else _mean(theirs)), *_ends(ends))
    return _over_seeds(ours, theirs, seeds)


def _ends(ends: Any) -> tuple[float, float]:
    return (ends["low"], ends["high"]) if isinstance(ends, Mapping) else (ends[0], ends[1])


def _mean(value: Any) -> float:
    return float(value["mean"] if isinstance(value, Mapping) else value)


def _over_seeds(ours: Any, theirs: Any, seeds: int) -> Figure:
    """A figure or a difference of two; its interval is that of the means over as many seeds, by Student's t.

    Of one seed it is the interval over individuals, of a difference the widest that its two intervals allow.
    """
    value = _mean(ours) - (0.0 if theirs is None else _mean(theirs))
    parts = [part for part in (ours, theirs) if isinstance(part, Mapping)]
    if seeds > 1 and parts and all(part["std"] is not None for part in parts):
        half = T_95[len(parts) * (seeds - 1)] * math.sqrt(sum(part["std"] ** 2 for part in parts) / seeds)
        return Figure(value, value - half, value + half)
    if not parts or any("interval_95" not in part for part in parts):
        return Figure(value)
    low, high = parts[0]["interval_95"]
    less = (0.0, 0.0) if theirs is None else parts[1]["interval_95"]
    return Figure(value, low - less[1], high - less[0])


def ledger_of(results: Path, claims: tuple[Claim, ...] | None = None) -> tuple[Entry, ...]:
    """Every claim with our figure and the verdict.

    Args:
        results: folder of results.
        claims: those of the package if None.

    Raises:
        UserError: as `figure_of`.
    """
    found = [(claim, figure_of(claim, results)) for claim in (read_claims() if claims is None else claims)]
    return tuple(Entry(claim, figure, verdict(claim, figure)) for claim, figure in found)
