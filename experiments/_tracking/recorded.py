"""Rows of captures with masks: tracks and labels, and the labels of a camera that is wrong and corrected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import jax
import numpy as np

from aerojax.capture.format import Capture
from aerojax.classify.base import Classifier
from aerojax.classify.familiarity import Familiarity
from aerojax.evaluate.tracking import TrackingFrame, owners, tracking_figures
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.several import TracksOfRecording, classify_tracks
from aerojax.pipeline.source import capture_frames, capture_preview
from aerojax.pipeline.step import make_pipeline
from aerojax.pipeline.trust import TrustConfig
from aerojax.track.adjust.outlines import mask_outlines
from aerojax.track.masks import mask_detections
from aerojax.track.recordings import recalibrated
from aerojax.track.sights import timed
from aerojax.track.truth import truth_at
from experiments._tracking.detections import MeasuredConfig, Row, recovered, with_wrong_pose


@dataclass(frozen=True)
class Asked:
    """What captures are put through; familiarity: of the classifier, None to call nothing unknown."""

    pipeline: PipelineConfig
    classifier: Classifier
    familiarity: Familiarity | None
    trust: TrustConfig
    seed: int


def tracks_row(capture: Capture, asked: Asked) -> Row:
    """Tracks of the masks' instances as the stream believes them frame by frame, and the answer of each."""
    found = _classified(capture, asked)
    frames = _beside(found, capture)
    return {**asdict(tracking_figures(frames)), "tracks": _labelled(found, frames, capture)}


def poses_row(capture: Capture, number: int, asked: Asked, measured: MeasuredConfig) -> Row:
    """One camera that is wrong: answers with it, and with the cameras that the tracks say there should be."""
    cameras = tuple(timed(camera) for camera in capture.cameras)
    which, what, given = with_wrong_pose(cameras, number, measured.errors, np.random.default_rng([asked.seed, number]))
    seen = mask_detections(capture)
    found, errors = recovered(seen, given, cameras, measured, outlines=mask_outlines(capture))
    captures = {"true": capture, "given": recalibrated(capture, given), "found": recalibrated(capture, found)}
    answers = {name: count_answers(tracks_row(one, asked)["tracks"]) for name, one in captures.items()}
    return {"camera": which, "wrong": what, **errors, "answers": answers}


def _classified(capture: Capture, asked: Asked) -> TracksOfRecording:
    made = capture.cameras, asked.pipeline, asked.classifier
    pipeline = make_pipeline(*made, key=jax.random.key(asked.seed), familiarity=asked.familiarity)
    source, preview = capture_frames(capture), capture_preview(capture)
    return classify_tracks(pipeline, source, preview, trust=asked.trust, fps=capture.fps)


def _beside(found: TracksOfRecording, capture: Capture) -> list[TrackingFrame]:
    assert capture.truth is not None  # the simulator writes it
    frames = []
    for one in found.moments:
        truth = truth_at(capture.truth, one.frame / capture.fps, capture.fps)
        frames.append(TrackingFrame(*truth, one.numbers, one.places))
    return frames


def _labelled(found: TracksOfRecording, frames: Sequence[TrackingFrame], capture: Capture) -> list[Row]:
    """A row for every track that is of an object: what that is, and what the track was taken for."""
    assert capture.truth is not None
    classes = {one.object_id: one.class_name for one in capture.truth.objects}
    rows = []
    for track, thing in owners(frames).items():
        answer = found.answers.get(track)
        said = {"label": None, "status": None, "unknown": False, "frames": 0}
        if answer is not None:
            verdict = {"status": answer.verdict.status, "unknown": answer.verdict.unknown}
            said = {"label": answer.label, **verdict, "frames": answer.frames}
        rows.append({"track": track, "object": thing, "true": classes[thing], **said})
    return rows


def count_answers(tracks: Sequence[Row]) -> dict[str, int]:
    """Tracks, those with a likeliest class, those of which a class is the answer, and how many of both are right.

    Of the others, how many are called unknown.
    """
    answered = [one for one in tracks if one["label"] is not None]
    sure = [one for one in answered if one["status"] == "ok" and not one["unknown"]]
    right = [sum(one["label"] == one["true"] for one in some) for some in (answered, sure)]
    return {
        "tracks": len(tracks),
        "answered": len(answered),
        "right": right[0],
        "sure": len(sure),
        "sure_right": right[1],
        "unknown": sum(one["status"] == "ok" and one["unknown"] for one in answered),
    }
