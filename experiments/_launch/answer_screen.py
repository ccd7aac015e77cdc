"""What `classify` says on the screen."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from aerojax.capture.format import Capture
from aerojax.pipeline.results import headline


def show_answer(console: Console, result: dict[str, Any], capture: Capture, truth: str | None) -> None:
    """The answer, probabilities, times, frames used and dropped, and warnings.

    Args:
        console: where to.
        result: contents of `result.json`.
        capture: what was classified.
        truth: its class, where it is known.
    """
    console.print(f"{capture.folder.name}: [bold]{escape(headline(result))}[/bold]", soft_wrap=True)
    table = Table("class", "probability")
    for name, value in sorted(result["probabilities"].items(), key=lambda item: -item[1]):
        table.add_row(name, f"{value:.4f}")
    console.print(table)
    spent = Table("stage", "median ms a frame")
    for name, value in result["latency_ms"].items():
        spent.add_row(name, f"{value:.1f}")
    console.print(spent)
    answer = result["label"] or result["most_likely"]
    known = "" if truth is None else f"; truth: {truth}, {'right' if truth == answer else 'wrong'}"
    console.print(f"frames used: {len(result['frames'])} of {capture.frames}, cameras: {len(capture.cameras)}{known}")
    reasons = {frame: event["text"] for frame, event in result["dropped"].items()}
    for reason in sorted(set(reasons.values())):
        frames = [frame for frame, why in reasons.items() if why == reason]
        console.print(f"dropped {len(frames)} frame(s) ({', '.join(frames)}): {reason}")
    for warning in result["warnings"]:
        console.print(f"[yellow]warning:[/yellow] {escape(warning)}", soft_wrap=True)
