"""The ledger as a page: claims by table of the thesis with verdicts, and the commands that measured them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from aerojax.core.provenance import command_of_result
from aerojax.evaluate.ledger import VERDICTS, Entry, Figure
from aerojax.evaluate.ledger_runs import command_of
from aerojax.evaluate.markdown import table_lines

HEAD = """# Ledger: the thesis' claims, measured again

The claims of the thesis' chapter 6 and its appendices, one line each, beside what this repository measures. **Wherever
the column "data" says "own", the measurement is on sequences of our own simulator, with our own models of aircraft and
birds, and mostly with shorter clips and shorter training than the thesis had.** There an order of two figures can be
reproduced or contradicted; an absolute figure cannot be reproduced, it can be beaten, be lower, or leave it undecided.
"same" are quantities that do not depend on data, such as counts of parameters. Intervals are 95 %: over individuals
where the file of results has one, else over seeds by Student's t.
"""
FOOT = (
    """Made by `python -m experiments.reproduce` from the files of `results/`; `run=true` measures what is missing."""
)


def ledger_markdown(entries: Sequence[Entry], results: Path) -> str:
    """The whole page.

    Args:
        entries: of `ledger_of`.
        results: the folder that they were looked up in, for commands, seeds and commits.
    """
    counts = Counter(entry.verdict for entry in entries)
    lines = [
        HEAD,
        *table_lines(["verdict", "claims", "meaning"], [[v, str(counts[v]), m] for v, m in VERDICTS.items()]),
    ]
    for source in dict.fromkeys(entry.claim.source for entry in entries):
        rows = [_row(entry) for entry in entries if entry.claim.source == source]
        lines += ["", f"## {source}", ""]
        lines += table_lines(["claim", "thesis", "here", "data", "verdict", "measured by"], rows)
    lines += ["", "## What measured it", ""]
    lines += table_lines(["file", "command", "seeds", "commit"], _origins(entries, results))
    return "\n".join([*lines, "", FOOT]) + "\n"


def _row(entry: Entry) -> list[str]:
    claim = entry.claim
    text = claim.text + (f" *{claim.note}*" if claim.note else "")
    if entry.figure is None:
        command = command_of(claim.result) if claim.result else None
        wanted = "" if command is None else f"not run yet: `{command}`"
        return [text, claim.thesis, "", "", entry.verdict, wanted]
    data = "own" if claim.own else "same"
    ours = shown(entry.figure, claim.shown, difference=claim.is_difference)
    return [text, claim.thesis, ours, data, entry.verdict, f"`{claim.result}.json`"]


def shown(figure: Figure, how: str, *, difference: bool = False) -> str:
    """A figure with its interval: shares in percent, differences of shares in points."""
    scale, number, unit = (100.0, f"{how[:-1]}f", " %") if how.endswith("%") else (1.0, how, "")
    if difference and unit:
        number, unit = f"+{number}", " points"
    value = f"{scale * figure.value:{number}}{unit}"
    if figure.low is None or figure.high is None:
        return value
    return f"{value} ({scale * figure.low:{number}} to {scale * figure.high:{number}})"


def _origins(entries: Sequence[Entry], results: Path) -> list[list[str]]:
    names = dict.fromkeys(entry.claim.result for entry in entries if entry.figure is not None)
    found = {name: json.loads((results / f"{name}.json").read_text(encoding="utf-8")) for name in names}
    return [[f"`{name}.json`", f"`{_command(one)}`", _seeds(one), _commits(one)] for name, one in sorted(found.items())]


def _command(values: dict[str, Any]) -> str:
    return command_of_result(values) or "; ".join(values["commands"])


def _seeds(values: dict[str, Any]) -> str:
    rows = values.get("rows")
    rows = rows if isinstance(rows, list) else []
    several = {seed for row in rows if isinstance(row, dict) for seed in row.get("seeds", ())}
    return ", ".join(map(str, sorted(several))) or str(values.get("seed", "-"))


def _commits(values: dict[str, Any]) -> str:
    commits = values.get("commits") or [values.get("commit", "-")]
    return ", ".join(dict.fromkeys(_short(str(commit)) for commit in commits))


def _short(commit: str) -> str:
    number, _, changes = commit.partition("+")
    return number[:7] + (" with changes" if changes else "")
