"""What `eval_rotation` shows of a classifier: a row a protocol, recall, and accuracy after so many frames."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table


def show_rotations(console: Console, figures: dict[str, Any]) -> None:
    """Print figures that have the form of the act's results.json."""
    table = Table("protocol", "clips", "videos", "95 %", "macro-F1", "ECE", "ECE with T")
    for name, kind in figures["protocols"].items():
        row = figures["rotations"][kind]
        low, high = row["interval_95"]["video_accuracy"]
        spread = [f"{100 * row[k]['mean']:.1f}±{100 * row[k]['std']:.1f}" for k in ("clip_accuracy", "video_accuracy")]
        first = row["trials"][0]["clip"]
        mended = first["ece_with_temperature"]
        errors = f"{first['ece']:.3f}", "-" if mended is None else f"{mended:.3f}"
        table.add_row(
            name, *spread, f"{100 * low:.1f}…{100 * high:.1f}", f"{100 * row['video_macro_f1']['mean']:.1f}", *errors
        )
    console.print(table)
    console.print("accuracy in %; interval of the videos' by resampling identities; T fitted on val")
    recall = figures["rotations"]["none"]["trials"][0]["video"]["recall"]
    shares = "  ".join(f"{c} {100 * r:.1f}" for c, r in zip(figures["classes"], recall, strict=True) if r is not None)
    console.print(f"video recall, unturned: {shares}")
    curve = "  ".join(f"{row['frames']}: {100 * row['accuracy']:.1f}" for row in figures["prefix_accuracy"])
    console.print(f"clip accuracy after n frames: {curve}")
    console.print(f"with frames shuffled: {100 * figures['shuffled_frames']['clip']['accuracy']:.1f}")
