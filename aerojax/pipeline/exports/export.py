"""What of a classified clip is written beside its result, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

from aerojax.capture.format import Capture
from aerojax.pipeline.exports.coco import export_coco
from aerojax.pipeline.exports.gaussians import export_ply, export_usd
from aerojax.pipeline.exports.sapient import export_sapient, require_sapient
from aerojax.pipeline.exports.tables import export_csv, export_jsonl
from aerojax.pipeline.exports.video import export_videos
from aerojax.pipeline.offline import Clip
from aerojax.pipeline.results import answer_of
from aerojax.pipeline.track_points import track_points

ExportName = Literal["ply", "usd", "csv", "jsonl", "coco", "video", "sapient"]
"""What can be taken along:

ply: the Gaussians, a file a frame. usd: the same as one stage with time samples.
csv, jsonl: the track with time, position, velocity, size and label so far, and the answer.
coco: masks and boxes back in each image. video: overlay videos of each camera and a mosaic.
sapient: detection reports of BSI Flex 335.
"""


def require_exports(capture: Capture, names: Sequence[ExportName], began: str) -> None:
    """Refuse at once, before anything is reconstructed, what `export_clip` would refuse.

    Raises:
        UserError: an optional package is not there, or the capture lacks what an export needs.
    """
    if "sapient" in names:
        require_sapient(capture, began)


def export_clip(
    capture: Capture,
    clip: Clip,
    names: Sequence[ExportName],
    folder: Path,
    *,
    began: str = "1970-01-01T00:00:00Z",
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> dict[str, Path]:
    """Write the exports; a name that stands twice is written once.

    Args:
        capture: what was classified.
        clip: of it, from a classifier, with its observations.
        names: what to write.
        folder: where it goes; made if it is not there.
        began: time of frame 0 for messages that need one, ISO 8601.
        progress: called with (done, total, what) as exports are written.

    Returns:
        The file or folder of each; nothing is written of an object without a place, as every export tells of that.

    Raises:
        UserError: an optional package is not there, or the capture lacks what an export needs.
    """
    if not clip.frames:
        return {}
    points = track_points(capture, clip)
    write: dict[str, Callable[[], Path]] = {
        "ply": lambda: export_ply(clip, folder / "ply"),
        "usd": lambda: export_usd(capture, clip, folder / "gaussians.usdc"),
        "csv": lambda: export_csv(points, answer_of(clip), folder / "track.csv"),
        "jsonl": lambda: export_jsonl(points, answer_of(clip), folder / "track.jsonl"),
        "coco": lambda: export_coco(capture, clip, points, folder / "coco.json"),
        "video": lambda: export_videos(capture, clip, points, folder / "video", progress=progress),
        "sapient": lambda: export_sapient(capture, points, folder / "sapient.jsonl", began),
    }
    written: dict[str, Path] = {}
    for name in dict.fromkeys(names):
        written[name] = write[name]()
        progress(len(written), len(names), name)
    return written
