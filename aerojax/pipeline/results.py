"""A clip as it is written down: what was answered, from which frames, and what its reader should know."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from aerojax.capture.format import Capture
from aerojax.core.types import CLASSES, UNKNOWN
from aerojax.pipeline.offline import Clip
from aerojax.pipeline.track_points import TrackPoint, track_points

FORMAT, VERSION = "aerojax-result", 2
"""What `result.json` says of itself. The version grows when a key changes its meaning or goes; new keys may come.

2: `label` may be "unknown", and `reasons` then says why although the status is ok.
"""
SCHEMA = Path(__file__).with_name("result.schema.json")
"""JSON Schema (draft 2020-12) of `result.json`."""
_FIGURES = ("ray_px", "ray_m", "shift_px", "shift_m", "uncovered")


def result_of(capture: Capture, clip: Clip) -> dict[str, Any]:
    """The contents of `result.json`.

    Args:
        capture: what was classified.
        clip: of it, from a classifier.

    Returns:
        status ("ok", "unsure", "insufficient") with its reasons; label, None unless the status is ok, and "unknown" for
        what is like none of the classes; the most likely class and the probabilities after the last frame, as if it
        were one of them; familiarity, see `TrustConfig`; the set of classes that it could be of with its coverage, see
        `AnswerSet`, or None; level of the cameras' disagreement, and how well each agrees, see `agreement_of`; frames
        that were used, and those that were dropped with code and text; of an object without a place, by number of the
        frame the camera that alone shows it, of which the probabilities come, else None; by camera, the frames that it
        was left out of, and why; what the masks hold ("ids", "picture" or None); warnings; the track, see
        `TrackPoint`, empty without a place; median milliseconds a stage. `result_schema` describes all of it.
    """
    assert clip.log_probabilities is not None  # there was a classifier
    probabilities = dict(zip(CLASSES, np.exp(clip.log_probabilities[-1]).tolist(), strict=True))
    most_likely = max(probabilities, key=lambda name: probabilities[name])
    return {
        "format": FORMAT,
        "version": VERSION,
        "capture": str(capture.folder),
        "status": clip.verdict.status,
        "reasons": [{"code": reason.code, "text": reason.text} for reason in clip.verdict.reasons],
        "label": answer_of(clip),
        "most_likely": most_likely,
        "probabilities": probabilities,
        "familiarity": clip.verdict.familiarity,
        "answer_set": None if clip.answer_set is None else asdict(clip.answer_set),
        "frames": list(clip.frames),
        "dropped": {str(event.frame): {"code": event.code, "text": event.text} for event in clip.dropped},
        "one_camera": {str(frame): capture.cameras[one.camera].name for frame, one in clip.one_camera.items()} or None,
        "missing": {camera.name: _missing(clip, index) for index, camera in enumerate(capture.cameras)},
        "disagreement": clip.verdict.disagreement,
        "cameras": agreement_of(capture, clip),
        "masks": capture.mask_kind,
        "warnings": list(clip.warnings),
        "latency_ms": clip.latency_ms,
        "track": [point_json(point) for point in track_points(capture, clip)],
    }


def answer_of(clip: Clip) -> str | None:
    """The answer: a class, "unknown", or None where the verdict's status is not ok."""
    assert clip.log_probabilities is not None  # there was a classifier
    if clip.verdict.status != "ok":
        return None
    return UNKNOWN if clip.verdict.unknown else CLASSES[int(np.argmax(clip.log_probabilities[-1]))]


def point_json(point: TrackPoint) -> dict[str, Any]:
    """A point of the track as JSON has it; its place on the earth only where it is known."""
    content = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(point).items()}
    return {key: value for key, value in content.items() if key != "place" or value is not None}


def result_schema() -> dict[str, Any]:
    """The JSON Schema of `result.json`, as the package ships it."""
    return json.loads(SCHEMA.read_text(encoding="utf-8"))


def agreement_of(capture: Capture, clip: Clip) -> dict[str, dict[str, Any]]:
    """How well each camera agrees with the others: medians over the frames used, and under `frames` every frame's.

    ray_px, ray_m, shift_px, shift_m and uncovered are those of `Consistency`, None where nothing is known. suspect: the
    likely cause, turned degrees, seconds late, and the offset of the camera that is wrong; None for the others.
    """
    found = {}
    for index, camera in enumerate(capture.cameras):
        by_frame = {name: _over_time(clip, name, index) for name in _FIGURES}
        medians = {name: _median(values) for name, values in by_frame.items()}
        guess = clip.verdict.suspect
        suspect = asdict(guess) if guess is not None and guess.camera == index else None
        frames = {name: [_plain(value) for value in values] for name, values in by_frame.items()}
        found[camera.name] = {**medians, "suspect": suspect, "frames": frames}
    return found


def headline(result: Mapping[str, Any]) -> str:
    """The answer in one line: a label, and why it is none of the classes or not sure."""
    why = "; ".join(reason["text"] for reason in result["reasons"])
    if result["status"] == "ok":
        return f"{result['label']}: {why}" if why else result["label"]
    return f"not sure (most likely {result['most_likely']}): {why}"


def _over_time(clip: Clip, name: str, camera: int) -> np.ndarray:
    return np.array([getattr(one, name)[camera] for one in clip.consistency])


def _median(values: np.ndarray) -> float | None:
    known = values[np.isfinite(values)]
    return _plain(float(np.median(known))) if len(known) else None


def _plain(value: float) -> float | None:
    return round(float(value), 5) if np.isfinite(value) else None


def _missing(clip: Clip, camera: int) -> dict[str, str]:
    return {str(frame): view.text for frame, view in clip.missing if view.camera == camera}
