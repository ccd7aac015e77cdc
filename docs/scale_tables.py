"""What a hundred thousand sequences cost, from measured rates."""

from __future__ import annotations

from dataclasses import dataclass

from result_cells import load, markdown

SEQUENCES = 100_000
CORES = 2, 64, 1024


@dataclass(frozen=True)
class Work:
    """One thing that is done to a sequence. core_s: processor seconds a sequence. source: file of results/."""

    what: str
    core_s: float
    source: str


def works() -> list[Work]:
    """Everything whose rate is known."""
    rows = []
    for row in load("benchmark_simulator")["simulator"]["throughput"]:
        cameras, frames = row["images"] // (row["sequences"] * row["frames"]), row["frames_of_the_preset"]
        what = f"simulate: {row['rig']}, `preset={row['preset']}`, {cameras} cameras, {frames} frames"
        rows.append(Work(what, cameras * frames / row["images_per_cpu_s"], "benchmark_simulator"))
    made = load("benchmark_factory")["factory"]
    both = f"simulate and reconstruct: small random networks, {made['frames']} frames"
    rows.append(Work(both, 1 / made["sequences"]["clips_per_cpu_s"], "benchmark_factory"))
    clip = f"a clip of the factory instead, {made['frames']} frames"
    rows.append(Work(clip, 1 / made["factory"]["clips_per_cpu_s"], "benchmark_factory"))
    trained, clips = load("train_classifier_small"), load("fit_familiarity")["training_clips"]
    spent = 60 * 2 * trained["minutes"] / clips  # of both cores, as if both were busy throughout
    rows.append(Work(f"train {trained['networks']} networks on a clip, 8 passes", spent, "train_classifier_small"))
    archive = load("benchmark_archive")["archive"]
    size = "×".join(map(str, archive["pixels"]))
    read = f"`classify_archive`: {archive['cameras']} cameras of {size}, {archive['frames']} frames, masks given"
    rows.append(Work(read, archive["rows"][0]["cpu_s_a_capture"], "benchmark_archive"))
    return rows


def _hours(core_s: float) -> str:
    hours = core_s / 3600
    return f"{60 * hours:.0f} min" if hours < 1 else f"{hours:,.0f} h" if hours >= 10 else f"{hours:.1f} h"


def scale_costs() -> str:
    """Processor time of a sequence, and hours for `SEQUENCES` on so many cores that do not hinder each other."""
    rows = []
    for work in works():
        total = work.core_s * SEQUENCES
        times = [_hours(total / cores) for cores in CORES]
        rows.append([work.what, f"{work.core_s:.2f} s", *times, f"`{work.source}.json`"])
    head = ["a sequence", "processor time", *(f"{SEQUENCES:,} on {cores:,} cores" for cores in CORES), "measured in"]
    return markdown(head, rows)
