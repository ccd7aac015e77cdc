"""Several objects of a recording: where each track was in every frame, and what each is taken for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64

from aerojax.core.types import CLASSES, FrameSet
from aerojax.pipeline.events import Updated
from aerojax.pipeline.step import Pipeline
from aerojax.pipeline.trust import Record, TrustConfig, Verdict, judge
from aerojax.segment.base import Preview
from aerojax.track.several import SeveralState


@dataclass(frozen=True, eq=False)
class Believed:
    """The tracks that are believed after a frame, also those that no camera shows just now.

    frame: its number. numbers: of the tracks. places: metres, world.
    """

    frame: int
    numbers: Int64[np.ndarray, "track"]
    places: Float64[np.ndarray, "track 3"]


@dataclass(frozen=True, eq=False)
class TrackAnswer:
    """What a track is taken for.

    frames: in which it was seen by enough cameras. log_probabilities: of the classes after the last of them.
    verdict: whether that may be believed.
    """

    frames: int
    log_probabilities: Float32[np.ndarray, "label"]
    verdict: Verdict

    @property
    def label(self) -> str:
        """The likeliest class."""
        return CLASSES[int(np.argmax(self.log_probabilities))]


@dataclass(frozen=True, eq=False)
class TracksOfRecording:
    """What became of a recording.

    moments: one a frame; none where the tracker follows one object. answers: by track, of those that could be used.
    """

    moments: tuple[Believed, ...]
    answers: dict[int, TrackAnswer]


def classify_tracks(
    pipeline: Pipeline,
    source: Iterable[FrameSet],
    preview: Preview | None = None,
    *,
    trust: TrustConfig,
    fps: float | None = None,
) -> TracksOfRecording:
    """Every track of a recording with its own answer: the fold of the frame step, which keeps one state a track.

    Args:
        pipeline: with a causal classifier, since every frame is answered as it comes.
        source: frame sets in the order of time.
        preview: that the segmenter may look at before.
        trust: from when on an answer is believed.
        fps: says lateness in frames, too.
    """
    counts: Counter[int] = Counter()
    last: dict[int, Float32[np.ndarray, "label"]] = {}
    familiar: dict[int, float | None] = {}
    records: dict[int, Record] = {}
    moments: list[Believed] = []
    state = pipeline.initial(preview)
    for frames in source:
        events, state = pipeline.step(frames, state)
        for event in events:
            if isinstance(event, Updated) and event.log_probabilities is not None:
                counts[event.track] += 1
                last[event.track], familiar[event.track] = event.log_probabilities, event.familiarity
        records |= {number: one.record for number, one in state.objects.items()}
        if isinstance(state.track, SeveralState):
            moments.append(_believed(frames.frame, state.track, pipeline.world_from_rig))
    answers = {}
    for number, said in last.items():
        known = {"fps": fps, "familiarity": familiar[number]}
        answers[number] = TrackAnswer(
            counts[number], said, judge(records[number], pipeline.cameras, said, trust, **known)
        )
    return TracksOfRecording(tuple(moments), answers)


def _believed(frame: int, state: SeveralState, world_from_rig: Float64[np.ndarray, "4 4"]) -> Believed:
    known = [(one.number, one.mean[:3]) for one in state.following.tracks if one.number is not None]
    places = np.array([place for _, place in known], np.float64).reshape(-1, 3)
    world = places @ world_from_rig[:3, :3].T + world_from_rig[:3, 3]
    return Believed(frame, np.array([number for number, _ in known], np.int64), world)
