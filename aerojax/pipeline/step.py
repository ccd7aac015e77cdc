"""The frame step: the only place where the stages meet.

Everything runs in the rig's frame, that of the first camera: grids, seeds and farthest points are then the same numbers
however the world is placed, and 32-bit floats keep their digits however far the rig is from the world's origin.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Float64, Int, Key

from aerojax.capture.format import CaptureCamera
from aerojax.classify.base import Classifier, Embedding
from aerojax.classify.familiarity import Familiarity
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES, Crops, Evidence, FrameSet, Gaussians, Observation, Track, View
from aerojax.gaussians.decimate import DecimationConfig, decimate
from aerojax.pipeline.config import PipelineConfig, clip_settings
from aerojax.pipeline.events import Appeared, Dropped, Event, Lost, OneCamera, Updated
from aerojax.pipeline.stopwatch import Stopwatch
from aerojax.pipeline.trust import Record
from aerojax.reconstruct.alignment import reconstruct_aligned
from aerojax.reconstruct.base import Reconstructor
from aerojax.reconstruct.consistency import consistency
from aerojax.reconstruct.crop import small_crops
from aerojax.reconstruct.cut_views import FEWEST_WHOLE
from aerojax.reconstruct.observe import observe, usable
from aerojax.segment.base import Preview, Segmenter
from aerojax.track.base import Tracker


@dataclass(frozen=True, eq=False)
class TrackState:
    """One object.

    last_seen: frame. classify: what the classifier remembers. record: by which `trust.judge` judges the answer.
    one_camera: what the classifier remembers of frames that one camera shows, while no frame has shown the object to
        several; else None.
    """

    last_seen: int
    classify: Any
    record: Record
    one_camera: Any = None


@dataclass(frozen=True, eq=False)
class PipelineState:
    """What is remembered from frame to frame; its size does not grow with their number."""

    segment: Any
    track: Any
    objects: Mapping[int, TrackState]


@dataclass(frozen=True, eq=False)
class Pipeline:
    """Stages put together for one network of cameras; make it with `make_pipeline`.

    cameras: in the rig's frame. world_from_rig: rigid transform, metres.
    classifier: None to reconstruct alone.
    key: seeds the decimation, frame by frame.
    familiarity: what the classifier knows; None to call nothing unknown.
    watch: collects the milliseconds of each stage.
    """

    cameras: tuple[CaptureCamera, ...]
    world_from_rig: Float64[np.ndarray, "4 4"]
    config: PipelineConfig
    segmenter: Segmenter
    tracker: Tracker
    reconstructor: Reconstructor
    classifier: Classifier | None
    key: Key[Array, ""]
    familiarity: Familiarity | None = None
    watch: Stopwatch = field(default_factory=Stopwatch)

    def initial(self, preview: Preview | None = None) -> PipelineState:
        """The state before the first frame; without a preview nothing looks ahead.

        Raises:
            UserError: the preview shows that the object to follow is not there.
        """
        return PipelineState(self.segmenter.initial(self.cameras, preview), self.tracker.initial(self.cameras), {})

    def step(self, frames: FrameSet, state: PipelineState) -> tuple[tuple[Event, ...], PipelineState]:
        """What one more frame shows.

        Args:
            frames: of the cameras of this pipeline, in their order; later than the last ones.
            state: from `initial` or the last step.
        """
        with self.watch.stage("segment"):
            silhouettes, segment = self.segmenter.step(frames, state.segment)
        with self.watch.stage("track"):
            tracks, track = self.tracker.step(frames, silhouettes, state.track)
        objects, events = dict(state.objects), []
        for one in tracks:
            before = objects.get(one.number)
            if before is None:
                events.append(Appeared(frames.frame, one.number))
                before = TrackState(frames.frame, self._unclassified(), Record.none(len(self.cameras)))
            said, objects[one.number] = self._follow(frames, one, before)
            events.append(said)
        if not tracks:
            events.append(self.too_few_views(frames, None, 0))
        for number, known in tuple(objects.items()):
            if frames.frame - known.last_seen > self.config.lost_after:
                events.append(Lost(frames.frame, number))
                del objects[number]
        return tuple(events), PipelineState(segment, track, objects)

    def observe(self, frames: FrameSet, track: Track, *, cut_views: bool = True) -> Observation | Dropped:
        """Cut out an object where enough cameras show it.

        Args:
            frames: the images. track: the object in them.
            cut_views: whether cameras whose border cuts the object count, if the reconstructor heeds what they do not
                show.
        """
        whole, cut_views = sum(usable(track.silhouettes)), cut_views and self.config.reconstruct.reads_known
        most = sum(one is not None for one in track.silhouettes) if cut_views else whole
        if whole < FEWEST_WHOLE or most < self.config.min_views:
            return self.too_few_views(frames, track.number, whole)
        with self.watch.stage("crop"):
            seen = observe(
                frames,
                track.silhouettes,
                self.cameras,
                size=self.config.crop_size,
                world_from_rig=self.world_from_rig,
                cut_views=cut_views,
            )
        return seen if seen.valid.sum() >= self.config.min_views else self.too_few_views(frames, track.number, whole)

    def _follow(self, frames: FrameSet, track: Track, before: TrackState) -> tuple[Updated | Dropped, TrackState]:
        """One object's event, and its next state."""
        seen = self.observe(frames, track)
        if isinstance(seen, Dropped):
            return self._unplaced(frames, track, seen, before)
        valid = jnp.asarray(seen.valid)
        made = reconstruct_aligned(
            partial(self._reconstruct, valid=valid), seen.views, seen.valid, whole=seen.whole, stage=self.watch.stage
        )
        met = made.count > 0
        with self.watch.stage("check"):
            focal = np.array([camera.K[0, 0] for camera in self.cameras])
            agreement = consistency(seen.views, seen.whole, focal, made.uncovered)
            record = before.record.seen(agreement, frames.time_s, seen.rig_from_crop[:3, 3], used=met)
        if not met:
            text = "the silhouettes of the cameras do not meet: check calibration, masks and synchronisation"
            dropped = Dropped(frames.frame, track.number, "silhouettes-disjoint", text, agreement)
            return dropped, TrackState(frames.frame, before.classify, record)
        with self.watch.stage("decimate"):
            shift = jnp.asarray(seen.rig_from_crop[:3, 3], jnp.float32)
            key = jax.random.fold_in(self.key, frames.frame)
            gaussians = jax.block_until_ready(
                decimate_in_rig(made.gaussians, made.count, shift, key, self.config.decimation)
            )
        evidence = Evidence(gaussians, self._crops(seen))
        probabilities, known, classify = self._classified(evidence, before.classify, record.used)
        position = seen.world_from_crop[:3, 3]
        largest, cut = float(made.shift_m.max()), tuple(int(i) for i in np.flatnonzero(seen.cut))
        updated = Updated(
            *(frames.frame, track.number, position, evidence, seen, probabilities, agreement, largest, cut, known)
        )
        return updated, TrackState(frames.frame, classify, record)

    def _unplaced(
        self, frames: FrameSet, track: Track, dropped: Dropped, before: TrackState
    ) -> tuple[Dropped, TrackState]:
        """The event of a frame that too few cameras show, with what one of them says, and the next state."""
        reads = self.classifier is None or self.classifier.reads_crops
        # From the first frame on that several show, theirs is the answer: one camera would not contradict it.
        if not reads or before.record.sums.frames or sum(usable(track.silhouettes)) != 1:
            return dropped, replace(before, last_seen=frames.frame, record=before.record.unused())
        with self.watch.stage("crop"):
            size, world_from_rig = self.config.crop_size, self.world_from_rig
            seen = observe(frames, track.silhouettes, self.cameras, size=size, world_from_rig=world_from_rig)
        evidence = Evidence(Gaussians.from_columns(jnp.zeros((0, 14))), self._crops(seen))
        state, logits = before.one_camera, None
        if self.classifier is not None and self.classifier.causal:
            with self.watch.stage("classify"):
                state = self.classifier.initial() if state is None else state
                logits, state = jax.block_until_ready(_classify(self.classifier, evidence, state))
                logits = np.asarray(logits)
        camera = int(np.flatnonzero(seen.whole)[0])
        box = seen.boxes[camera]
        assert box is not None  # it is whole there
        said = OneCamera(camera, box, evidence, logits)
        record = before.record.by_one_camera(max(box[2] - box[0], box[3] - box[1]))
        return replace(dropped, one_camera=said), TrackState(frames.frame, before.classify, record, state)

    def _reconstruct(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, int]:
        found, count = jax.block_until_ready(reconstruct_views(self.reconstructor, views, valid))
        return found, int(count)

    def _classified(
        self, evidence: Evidence, state: Any, used: int
    ) -> tuple[Float32[np.ndarray, "label"] | None, float | None, Any]:
        """Log-probabilities, the share of known objects as strange after so many used frames, and the next state."""
        if self.classifier is None or not self.classifier.causal:
            return None, None, state
        with self.watch.stage("classify"):
            if self.familiarity is None:
                logits, state = jax.block_until_ready(_classify(self.classifier, evidence, state))
                return np.asarray(logits), None, state
            assert isinstance(self.classifier, Embedding)  # `make_pipeline` has seen to it
            given = self.classifier, self.familiarity, evidence, state, jnp.asarray(used)
            logits, share, state = jax.block_until_ready(_classify_known(*given))
        return np.asarray(logits), float(share), state

    def _crops(self, seen: Observation) -> Crops:
        views = seen.views
        rgba = small_crops(np.asarray(views.rgb), np.asarray(views.mask), size=self.config.view_size)
        # Classifiers read whole objects: beside one whole crop, cut ones made their answers no better.
        return Crops(jnp.asarray(rgba), jnp.asarray(seen.whole))

    def _unclassified(self) -> Any:
        return self.classifier.initial() if self.classifier is not None and self.classifier.causal else None

    def too_few_views(self, frames: FrameSet, track: int | None, whole: int) -> Dropped:
        """The event of an object that `whole` cameras show whole; of no object where `track` is None."""
        text = f"{whole} of {len(self.cameras)} cameras see the whole object, {self.config.min_views} are needed"
        return Dropped(frames.frame, track, "too-few-views", text)


def make_pipeline(
    cameras: Sequence[CaptureCamera],
    config: PipelineConfig,
    classifier: Classifier | None = None,
    *,
    key: Key[Array, ""],
    object_id: int | None = None,
    familiarity: Familiarity | None = None,
) -> Pipeline:
    """Put the members that the configuration names together.

    Args:
        cameras: of the network, in the world's frame; the first one's frame is the rig's.
        config: names and sizes.
        classifier: from `load_classifier`; None to reconstruct alone.
        key: seeds the decimation.
        object_id: instance to follow where masks name instances; None to choose the largest.
        familiarity: of the classifier, from `load_familiarity`; None to call nothing unknown.

    Raises:
        UserError: the configuration contradicts the classifier's card, or that is for other classes; the classifier has
            no features for a familiarity.
    """
    if classifier is not None:
        classifier.card.require(clip_settings(config))
        if classifier.card.classes != CLASSES:
            problem = f"the classifier {classifier.card.name!r} tells {', '.join(classifier.card.classes)} apart"
            raise UserError("mismatch", problem, f"give weights for {', '.join(CLASSES)}")
    if familiarity is not None and not isinstance(classifier, Embedding):
        raise UserError(
            "mismatch", "the classifier gives no features, by which strange objects are told", "leave it out"
        )
    world_from_rig = np.asarray(cameras[0].world_from_cam)
    rig_from_world = np.linalg.inv(world_from_rig)
    in_rig = tuple(replace(c, world_from_cam=rig_from_world @ c.world_from_cam) for c in cameras)
    members = config.segment.build(object_id), config.track.build(), config.reconstruct.build()
    return Pipeline(in_rig, world_from_rig, config, *members, classifier, key, familiarity)


@jax.jit
def reconstruct_views(
    reconstructor: Reconstructor, views: View, valid: Bool[Array, "view"]
) -> tuple[Gaussians, Int[Array, ""]]:
    """What a reconstructor makes of one frame, compiled; see `Reconstructor`."""
    return reconstructor(views, valid)


@partial(jax.jit, static_argnames="config")
def decimate_in_rig(
    gaussians: Gaussians,
    count: Int[Array, ""] | int,
    rig_from_crop: Float[Array, "3"],
    key: Key[Array, ""],
    config: DecimationConfig,
) -> Gaussians:
    """Decimated in the crop's frame, then moved to the rig's, whose axes are the same."""
    kept = decimate(gaussians, count=count, key=key, config=config)
    return replace(kept, mean=kept.mean + rig_from_crop[None])


@jax.jit
def _classify(classifier: Classifier, seen: Evidence, state: Any) -> tuple[Float[Array, "label"], Any]:
    return classifier.step(seen, jnp.ones((), bool), state)


@jax.jit
def _classify_known(
    classifier: Embedding, familiarity: Familiarity, seen: Evidence, state: Any, used: Int[Array, ""]
) -> tuple[Float[Array, "label"], Float[Array, ""], Any]:
    logits, features, state = classifier.step_features(seen, jnp.ones((), bool), state)
    return logits, familiarity.share(features, used), state
