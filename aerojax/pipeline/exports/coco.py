"""Masks and boxes of a clip as COCO instances with scores: `annotations.json`, which names the capture's own images.

Pixels are those of the stored files. An image of a video is named `<video>#<frame>`, since COCO knows files alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aerojax.capture.format import Capture
from aerojax.capture.frames import source_frame
from aerojax.capture.paths import frame_path, is_video
from aerojax.core.files import write_json
from aerojax.core.types import CLASSES
from aerojax.data.exports.coco import CATEGORIES
from aerojax.data.exports.run_length import encode_mask
from aerojax.pipeline.exports.images import sightings
from aerojax.pipeline.offline import Clip
from aerojax.pipeline.results import answer_of
from aerojax.pipeline.track_points import TrackPoint


def export_coco(capture: Capture, clip: Clip, points: tuple[TrackPoint, ...], path: Path) -> Path:
    """Write images and annotations; the category is the likeliest class of the whole clip, `score` its probability.

    Beyond COCO's own keys, images carry `camera`, `frame` and `folder`, annotations `score`, `track_id`, the `label`
    so far and the whole clip's `answer`: a class, "unknown", or null where there is none.
    """
    last = points[-1]
    by_frame = {point.frame: point for point in points}
    images, annotations = [], []
    for number, seen in enumerate(sightings(capture, clip), start=1):
        images.append(_image(capture, seen.camera, seen.frame, number))
        x0, y0, x1, y1 = seen.box
        annotations.append(
            {
                "id": number,
                "image_id": number,
                "category_id": CLASSES.index(last.label) + 1,
                "bbox": [x0, y0, x1 - x0, y1 - y0],
                "area": int(seen.mask.sum()),
                "iscrowd": 0,
                "segmentation": encode_mask(seen.mask),
                "score": last.probabilities[last.label],
                "track_id": 1,
                "label": by_frame[seen.frame].label,
                "answer": answer_of(clip),
            }
        )
    info = {"description": f"aerojax: {capture.folder.name}", "version": "1.0"}
    content = {"info": info, "licenses": [], "categories": CATEGORIES, "images": images, "annotations": annotations}
    write_json(path, content, indent=None)
    return path


def _image(capture: Capture, index: int, frame: int, number: int) -> dict[str, Any]:
    camera = capture.cameras[index]
    own = source_frame(capture, index, frame)
    assert own is not None, "the object was seen in it"
    name = f"{camera.rgb}#{own}" if is_video(camera.rgb) else frame_path(camera.rgb, own)
    size = {"width": camera.width, "height": camera.height}
    return {
        "id": number,
        "file_name": name,
        **size,
        "camera": camera.name,
        "frame": frame,
        "folder": str(capture.folder),
    }
