"""Follow several objects: detections of any detector, or the instance masks of a capture, become tracks in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from aerojax.capture.format import write_capture_json
from aerojax.core.files import write_json
from aerojax.core.provenance import provenance
from aerojax.evaluate.tracking import TrackingFrame, tracking_figures
from aerojax.track.adjust.outlines import mask_outlines
from aerojax.track.adjust.problem import AdjustConfig
from aerojax.track.adjust.recording import Adjustment, adjust_recording, adjustment_to_json
from aerojax.track.camera_files import write_cameras
from aerojax.track.following import FollowingConfig
from aerojax.track.offline import follow
from aerojax.track.recordings import read_recording, recalibrated
from aerojax.track.sights import TimedCamera
from aerojax.track.state_files import read_state, write_state
from aerojax.track.track_files import write_tracks
from aerojax.track.truth import beside_truth
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config:
    """What was seen, by which cameras, and how it is followed.

    source: a capture with masks of instances; detections, a .jsonl or .csv file or a folder of them; or a recording of
        the public drone-tracking-datasets, its config_*.json.
    cameras: capture.json or a file like it without images; that of source if None.
    following: when sights are a track.
    find_corrections: whether to look for what is wrong with the cameras' clocks and poses.
    apply_corrections: whether to follow with what is found; it is only reported otherwise.
    adjust: what is looked for.
    state: that an earlier run left, to go on with the same numbers; none if None.
    """

    preset: str
    source: Path = field(metadata={"given": True})
    cameras: Path | None = None
    following: FollowingConfig = field(default_factory=FollowingConfig)
    find_corrections: bool = False
    apply_corrections: bool = False
    adjust: AdjustConfig = field(default_factory=AdjustConfig)
    state: Path | None = None


def show_corrections(found: Adjustment, cameras: Sequence[TimedCamera], console: Console) -> None:
    """A row a camera."""
    table = Table("camera", "ms late", "rate, ppm", "readout, ms", "turned, °", "moved, m", "off, px", "then")
    for camera, one, before, after in zip(cameras, found.corrections, found.before_px, found.after_px, strict=True):
        clock = (1e3 * one.offset_s, 1e6 * one.rate, 1e3 * one.line_delay_s * camera.height)
        pose = (f"{one.angle_deg:.3f}", f"{one.distance_m:.3f}")
        table.add_row(camera.name, *(f"{v:.1f}" for v in clock), *pose, f"{before:.1f}", f"{after:.1f}")
    console.print(table)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Write tracks.jsonl, tracks.csv, state.json, metrics.json; corrections.json and cameras.json where looked for.

    Of a capture, capture.json with the corrections too.
    """
    console, found = Console(), None
    with progress_bar() as bar:
        show = shown_in(bar)
        detections, cameras, capture = read_recording(config.source, config.cameras, progress=show)
        names = tuple(camera.name for camera in cameras)
        state = read_state(config.state, names) if config.state else None
        used = cameras
        if config.find_corrections or config.apply_corrections:
            outlines = mask_outlines(capture, progress=show) if capture is not None and config.adjust.poses else None
            # What a capture's image shows is of one instant.
            adjust = config.adjust if capture is None else replace(config.adjust, line_delay=False)
            asked = detections, cameras, config.following, adjust
            found = adjust_recording(*asked, outlines=outlines, progress=show)
            used = found.apply(cameras) if config.apply_corrections else cameras
        done = follow(detections, used, config.following, state=state, progress=show)
    for name in ("tracks.jsonl", "tracks.csv"):
        write_tracks(run.directory / name, done, used)
    write_state(run.directory / "state.json", done.state, names)
    if found is not None:
        told = {"applied": config.apply_corrections, "cameras": adjustment_to_json(found, cameras)}
        write_json(run.directory / "corrections.json", told)
        write_cameras(run.directory / "cameras.json", found.apply(cameras))
        if capture is not None:
            changed = recalibrated(capture, found.apply(cameras))
            write_capture_json(replace(changed, folder=run.directory), overwrite=True)
        show_corrections(found, cameras, console)
    paths = done.paths()
    counts = {"moments": len(done.moments), "tracks": len(paths), "detections": len(detections.camera)}
    counts["claimed"] = int(np.count_nonzero(done.owner >= 0))
    figures = {}
    if capture is not None and capture.truth is not None:
        beside = beside_truth(done, capture.truth, capture.fps)
        figures = asdict(tracking_figures([TrackingFrame(*one) for one in beside]))
    write_json(run.directory / "metrics.json", {**counts, "figures": figures, **provenance(run.overrides)})
    for number, (times, places) in sorted(paths.items()):
        where = ", ".join(f"{x:.1f}" for x in places[-1])
        console.print(f"track {number}: {times[0]:.2f} to {times[-1]:.2f} s, last at ({where}) m", markup=False)
    console.print(f"{counts['claimed']} of {counts['detections']} detections are of {len(paths)} tracks")
    console.print(f"{run.directory / 'tracks.jsonl'}", soft_wrap=True)


if __name__ == "__main__":
    main()
