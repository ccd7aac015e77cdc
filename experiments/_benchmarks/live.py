"""From the arrival of a frame's pictures to its tracks: `serve` on five cameras of 960×540, at a rate and flat out."""

from __future__ import annotations

import os
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax

from aerojax import __version__
from aerojax.classify.familiarity import load_familiarity
from aerojax.classify.load import load_classifier
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.step import make_pipeline
from aerojax.segment.base import SegmenterConfig
from aerojax.segment.instances import InstancesConfig
from aerojax.serve.config import LivePipelineConfig
from aerojax.serve.service import Service, ServiceConfig
from aerojax.serve.sinks.json_lines import JsonLines
from aerojax.serve.sources.playback import PlaybackConfig
from aerojax.simulate.plan.planner import SequenceConfig
from aerojax.simulate.sample import SampleConfig, sample_capture
from aerojax.simulate.world.random_rigs import RandomRigConfig

RIG = RandomRigConfig(cameras=5, span_px=(60.0, 60.0), distance=(20.0, 20.0))
SEQUENCE = SequenceConfig(rigs=(RIG,), frames=48, depth=False, white_dome=False)
RATES = (5.0, 0.0)
"""Frames a second at which the recording is played; 0 as fast as frames are taken."""
FRAMES = 240


def live_row(
    folder: Path, name: str, pipeline: PipelineConfig, rate: float, frames: int, weights: Path | None = None
) -> dict[str, Any]:
    """One run of the service over a recording that is played again and again, after one that compiles.

    Args:
        folder: of the capture.
        name: of the row.
        pipeline: members and sizes.
        rate: frames a second; 0 as fast as frames are taken.
        frames: that are measured.
        weights: of a causal classifier; the shipped ones if None.
    """
    spent = []
    for count in (min(frames, 10), frames):
        recorded = PlaybackConfig().build(folder).site.fps
        played = 0.0 if count < frames else rate / recorded
        source = PlaybackConfig(rate=played, repeat=0).build(folder)
        classifier, known = load_classifier(weights), load_familiarity(weights)
        made = make_pipeline(source.site.cameras, pipeline, classifier, key=jax.random.key(0), familiarity=known)
        with tempfile.TemporaryDirectory() as place:
            given = {"state": Path(place) / "state", "version": __version__}
            service = Service(source, made, [JsonLines(Path(place) / "out")], ServiceConfig(frames=count), **given)
            spent.append(service.run(threading.Event()))
    health = spent[-1]
    assert health.latency_ms is not None  # frames were looked at
    latency = {key: round(ms, 1) for key, ms in zip(("p50", "p95", "max"), health.latency_ms, strict=True)}
    return {
        "name": name,
        "asked_per_s": rate,
        "frames_per_s": round(health.rate, 2),
        "frame_to_track_ms": latency if rate else None,  # flat out, frames wait in the buffer however fast it goes
        "frames": health.frames,
        "dropped": health.dropped,
        "sightings": sum(health.sightings.values()),
        "stages_ms": {stage: round(ms, 2) for stage, ms in health.stages_ms.items()},
        "resident_mb": round(health.resources.resident_mb),
    }


def live_rows(folder: Path, rates: Sequence[float], frames: int) -> list[dict[str, Any]]:
    """Objects found without masks, and with masks that come with the images, at every rate."""
    members: dict[str, SegmenterConfig] = {"voxel_vote": LivePipelineConfig().segment, "instances": InstancesConfig()}
    return [
        live_row(folder, name, LivePipelineConfig(segment=member), rate, frames)
        for name, member in members.items()
        for rate in rates
    ]


def measure() -> dict[str, Any]:
    """Four runs of `FRAMES` frames: some minutes on two quiet cores, of which most is for the recording."""
    with tempfile.TemporaryDirectory() as place:
        sample = SampleConfig(folder=Path(place) / "samples", sequence=SEQUENCE)
        folder = sample_capture(sample, Path(place) / "assets")
        rows = live_rows(folder, RATES, FRAMES)
    return {
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        "load_average_at_the_end": os.getloadavg()[0],
        "cameras": RIG.cameras,
        "pixels": [RIG.width, RIG.height],
        "rows": rows,
    }
