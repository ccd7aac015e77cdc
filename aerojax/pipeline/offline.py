"""A whole capture: the fold of the frame step, put together as clips."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Float64, Key

from aerojax.capture.format import Capture
from aerojax.capture.frames import read_frames
from aerojax.classify.answer_sets import AnswerSet
from aerojax.classify.base import Classifier, Embedding
from aerojax.classify.familiarity import Familiarity
from aerojax.core.errors import UserError
from aerojax.core.types import Evidence, FrameSet, Gaussians, MissingView, Observation
from aerojax.gaussians.rotate import transform
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.events import Dropped, Lost, OneCamera, Updated
from aerojax.pipeline.source import capture_frames, capture_preview
from aerojax.pipeline.step import Pipeline, PipelineState, make_pipeline
from aerojax.pipeline.stream import stream
from aerojax.pipeline.trust import Record, TrustConfig, Verdict, judge
from aerojax.pipeline.warnings import (
    convention_of,
    cut_warnings,
    missing_warnings,
    one_camera_warnings,
    shift_warnings,
)
from aerojax.reconstruct.consistency import Consistency

Progress = Callable[[int, int, str], None]
"""Called with (done, total, what) as frames pass."""
_TRUST = TrustConfig()


@dataclass(frozen=True, eq=False)
class Clip:
    """One object of a capture in every usable frame.

    seen: Gaussians (rig frame, metres) and crops, leading axis time: of `frames`, or else of `one_camera`, and then
        crops alone. world_from_rig: rigid transform to the world.
    frames: numbers in the capture; none where the object has no place.
    position: centres, metres, world.
    log_probabilities: of the classes after each frame of `seen`; None without a classifier.
    dropped: frames that could not be used, and why.
    latency_ms: median milliseconds a frame, per stage.
    consistency: how well the cameras agree in each frame.
    verdict: whether the answer may be believed.
    observations: what was seen in each frame (kept only on request).
    missing: cameras that should have shown something and did not, with the numbers of their frames.
    warnings: what the user of the result should know, one sentence each.
    answer_set: the classes that the object could be of, if of one of them; None where that is not known.
    one_camera: where no frame shows the object to enough cameras for a place, what the camera that alone shows the
        whole of it shows, by the frame's number.
    """

    seen: Evidence
    world_from_rig: Float64[np.ndarray, "4 4"]
    frames: tuple[int, ...]
    position: Float64[np.ndarray, "time 3"]
    log_probabilities: Float32[np.ndarray, "answer label"] | None
    dropped: tuple[Dropped, ...]
    latency_ms: dict[str, float]
    consistency: tuple[Consistency, ...]
    verdict: Verdict
    observations: tuple[Observation, ...] = ()
    missing: tuple[tuple[int, MissingView], ...] = ()
    warnings: tuple[str, ...] = ()
    answer_set: AnswerSet | None = None
    one_camera: Mapping[int, OneCamera] = field(default_factory=dict)

    @property
    def gaussians(self) -> Gaussians:
        """Those of what was seen."""
        return self.seen.gaussians

    def in_world(self) -> Gaussians:
        """The Gaussians in the world's frame, metres; 32-bit floats lose digits far from its origin."""
        return transform(self.gaussians, jnp.asarray(self.world_from_rig, jnp.float32))


def reconstruct_capture(
    capture: Capture,
    config: PipelineConfig,
    classifier: Classifier | None = None,
    *,
    key: Key[Array, ""],
    object_id: int | None = None,
    trust: TrustConfig = _TRUST,
    familiarity: Familiarity | None = None,
    progress: Progress | None = None,
    keep_observations: bool = False,
) -> Clip:
    """Reconstruct the object in every frame of a capture, and classify it if there is a classifier.

    Of several objects that the tracker finds, the one with most frames. Where no frame shows it to enough cameras for a
    place and single ones show the whole of it, there are their crops alone, and a classifier of crops answers.

    Args:
        capture: at least three calibrated cameras.
        config: members and sizes.
        classifier: from `load_classifier`. One that is not causal is asked once, when all frames are known.
        key: seeds the decimation, frame by frame.
        object_id: instance to follow; the largest one if None. Ignored where the capture has no masks.
        trust: from when on the answer is believed.
        familiarity: of the classifier, from `load_familiarity`; None to call nothing unknown.
        progress: called after each frame.
        keep_observations: keep crops and boxes in the clip, for a report.

    Raises:
        UserError: no frame has enough views, or in none of those that have do they meet; the configuration contradicts
            the classifier's card.
    """
    pipeline = make_pipeline(capture.cameras, config, classifier, key=key, object_id=object_id, familiarity=familiarity)
    updates: dict[int, list[Updated]] = {}
    alone: dict[int, dict[int, OneCamera]] = {}
    dropped: list[Dropped] = []
    missing: list[tuple[int, MissingView]] = []
    source = _read(capture, pipeline, progress, missing)
    records: dict[int, Record] = {}  # of what was lost
    state = pipeline.initial(capture_preview(capture))
    for events, after in stream(pipeline, source, state):
        for event in events:
            if isinstance(event, Updated):
                updates.setdefault(event.track, []).append(
                    event if keep_observations else replace(event, observation=None)
                )
            elif isinstance(event, Dropped):
                dropped.append(replace(event, one_camera=None))
                if event.one_camera is not None and event.track is not None and not updates:
                    alone.setdefault(event.track, {})[event.frame] = event.one_camera
            elif isinstance(event, Lost):
                records[event.track] = _record(records, state, event.track)
        state = after
    warnings = (*capture.warnings, *missing_warnings(capture, missing))
    everything = [one for many in updates.values() for one in many]
    warnings = (*warnings, *shift_warnings(everything, capture.frames))
    warnings = (*warnings, *cut_warnings(everything, capture.cameras, capture.frames))
    disjoint = [event.frame for event in dropped if event.code == "silhouettes-disjoint"]
    convention = convention_of(capture, pipeline, disjoint) if 2 * len(disjoint) > capture.frames else None
    if convention is not None:
        warnings = (*warnings, f"the silhouettes meet if {convention.name}: {convention.remedy}")
    if not updates and (disjoint or not alone):
        reasons = "; ".join([*sorted({event.text for event in dropped}), *_disagreements(capture, state, trust)])
        raise UserError(
            "no-usable-frames",
            f"{capture.folder}: none of the {capture.frames} frames could be used ({reasons})",
            "; ".join(warnings) or "give frames in which more cameras see the whole object",
        )
    track = max(found := updates or alone, key=lambda number: len(found[number]))
    kept, by_one = updates.get(track, []), {} if updates else alone[track]
    answered = kept or list(by_one.values())
    seen = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(one.seen for one in answered))
    log_probabilities, known = _answers(pipeline, answered, seen)
    last = None if log_probabilities is None else log_probabilities[-1]
    record = _record(records, state, track)
    classes = None if last is None or familiarity is None or not kept else familiarity.answer_set(last, len(kept))
    return Clip(
        seen=seen,
        world_from_rig=pipeline.world_from_rig,
        frames=tuple(event.frame for event in kept),
        position=np.array([event.position for event in kept]).reshape(-1, 3),
        log_probabilities=log_probabilities,
        dropped=tuple(event for event in dropped if event.track in (None, track)),
        latency_ms=pipeline.watch.medians(),
        consistency=tuple(event.consistency for event in kept),
        verdict=judge(record, capture.cameras, last, trust, fps=capture.fps, familiarity=known),
        observations=tuple(event.observation for event in kept if event.observation is not None),
        missing=tuple(missing),
        warnings=(*warnings, *one_camera_warnings(by_one, capture.cameras, capture.frames)),
        answer_set=classes,
        one_camera=by_one,
    )


def observe_frame(capture: Capture, frame: int, config: PipelineConfig, *, object_id: int | None = None) -> Observation:
    """What the cameras of one frame that show the whole object saw of it, as `reconstruct_capture` cuts it out.

    Raises:
        UserError: there is no such frame, or fewer than `config.min_views` cameras see the whole object in it.
    """
    if not 0 <= frame < capture.frames:
        raise UserError(
            "out-of-range",
            f"frame={frame}: {capture.folder} has frames 0 to {capture.frames - 1}",
            "choose one of them",
        )
    pipeline = make_pipeline(capture.cameras, config, key=jax.random.key(0), object_id=object_id)
    state = pipeline.initial(capture_preview(capture))
    frames = read_frames(capture, frame)
    silhouettes, _ = pipeline.segmenter.step(frames, state.segment)
    tracks, _ = pipeline.tracker.step(frames, silhouettes, state.track)
    nobody = pipeline.too_few_views(frames, None, 0)
    seen = pipeline.observe(frames, tracks[0], cut_views=False) if tracks else nobody
    if isinstance(seen, Dropped):
        raise UserError("no-usable-frames", f"{capture.folder}: frame {frame}: {seen.text}", "choose another frame")
    return seen


def _read(
    capture: Capture, pipeline: Pipeline, progress: Progress | None, missing: list[tuple[int, MissingView]]
) -> Iterator[FrameSet]:
    """Frames with the time that it takes to read them; progress is called when one has been used.

    What is missing is added to the list.
    """
    source = capture_frames(capture)
    for done in range(capture.frames):
        with pipeline.watch.stage("read"):
            frames = next(source)
        missing.extend((frames.frame, view) for view in frames.missing)
        yield frames
        if progress is not None:
            progress(done + 1, capture.frames, "reconstruct")


def _record(lost: dict[int, Record], state: PipelineState, track: int) -> Record:
    """What is remembered of an object, before it was lost and since."""
    records = [lost[track]] if track in lost else []
    records += [state.objects[track].record] if track in state.objects else []
    return functools.reduce(operator.add, records)


def _disagreements(capture: Capture, state: PipelineState, trust: TrustConfig) -> list[str]:
    """What the cameras disagree about where no frame could be used."""
    verdicts = (judge(one.record, capture.cameras, None, trust, fps=capture.fps) for one in state.objects.values())
    return [reason.text for one in verdicts for reason in one.reasons if reason.code == "cameras-disagree"]


@jax.jit
def _clip(classifier: Classifier, seen: Evidence, valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
    return classifier.clip(seen, valid)


@jax.jit
def _clip_known(
    classifier: Embedding, familiarity: Familiarity, seen: Evidence, valid: Bool[Array, "time"]
) -> tuple[Float[Array, "time label"], Float[Array, ""]]:
    logits, features = classifier.clip_features(seen, valid)
    return logits, familiarity.share(features[-1], valid.sum())


def _answers(
    pipeline: Pipeline, kept: Sequence[Updated | OneCamera], seen: Evidence
) -> tuple[np.ndarray | None, float | None]:
    """Log-probabilities after each frame, and the familiarity after the last, which one camera does not tell."""
    if pipeline.classifier is None:
        return None, None
    if pipeline.classifier.causal:
        rows = np.stack([event.log_probabilities for event in kept if event.log_probabilities is not None])
        return rows, kept[-1].familiarity if isinstance(kept[-1], Updated) else None
    valid = jnp.ones(len(kept), bool)
    known = pipeline.familiarity is not None and isinstance(kept[-1], Updated)
    if not known or not isinstance(pipeline.classifier, Embedding):
        return np.asarray(_clip(pipeline.classifier, seen, valid)), None
    logits, share = _clip_known(pipeline.classifier, pipeline.familiarity, seen, valid)
    return np.asarray(logits), float(share)
