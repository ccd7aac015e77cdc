"""The member `voxel_vote`: objects are what moves in the images of several cameras at one place in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float32, UInt8

from aerojax.capture.format import CaptureCamera
from aerojax.core.colour import as_bytes, as_floats
from aerojax.core.types import FrameSet, Silhouette
from aerojax.segment.base import Preview, SegmenterConfig
from aerojax.segment.silhouettes import silhouette_of
from aerojax.segment.voxel_vote.agreement import uncontradicted
from aerojax.segment.voxel_vote.background import (
    EVERY,
    Background,
    BackgroundConfig,
    Difference,
    after,
    difference_at,
    difference_of,
    followed,
    learnt,
)
from aerojax.segment.voxel_vote.cluster import Candidate, Region, candidates
from aerojax.segment.voxel_vote.cue import CueConfig, common_gain, motion_weight, unlike_background
from aerojax.segment.voxel_vote.lingering import outline_of, without_lingering
from aerojax.segment.voxel_vote.objects import Known, ObjectsConfig, linked
from aerojax.segment.voxel_vote.previewed import previewed
from aerojax.segment.voxel_vote.registration import STILL
from aerojax.segment.voxel_vote.silhouette import MaskConfig, coverage_of, widened, without
from aerojax.segment.voxel_vote.sky import Sky, is_before, open_sky
from aerojax.segment.voxel_vote.volume import Volume, monitored_volume
from aerojax.segment.voxel_vote.vote import VoteConfig, vote

PREVIEWED = 15
"""Images whose median is the background."""
RELEARNT = 2
"""Times that a previewed background is learnt anew without the objects that it shows; the second knows them better."""
LOOKED_AT = 2
"""Of the previewed images one in so many is searched for objects; what lies between follows."""
KEPT_OF = 3
"""Of the frames before a background is known one in so many is kept."""
AROUND = 4
"""Pixels about an object that are no background either."""
CHANGES = 0.02
"""Change of a pixel since the last frame, grey, at least."""
FEWEST_CHANGED = 3
"""Pixels of an image in which an object changes."""
SAYING = 0.35
"""Share of the cameras that recognise a shadow, of those before which the background has a texture."""
UNLIKE = 0.6
"""Share of its background's texture that light leaves unexplained in a place's image, from which on it is an object."""
SAME_GAIN = 0.04
"""Between the gains that two cameras see of one shadow, at most."""


@dataclass(frozen=True)
class VoxelVoteConfig(SegmenterConfig):
    """What moves at one place in the images of several cameras (thesis, Appendix C); masks are not looked at.

    background: what a camera sees where nothing moves. cue: from differences to weights. vote: where the rays meet.
    masks: from voxels to pixels. objects: who is believed.
    """

    name: Literal["voxel_vote"] = "voxel_vote"
    background: BackgroundConfig = field(default_factory=BackgroundConfig)
    cue: CueConfig = field(default_factory=CueConfig)
    vote: VoteConfig = field(default_factory=VoteConfig)
    masks: MaskConfig = field(default_factory=MaskConfig)
    objects: ObjectsConfig = field(default_factory=ObjectsConfig)

    def build(self, object_id: int | None) -> VoxelVoteSegmenter:
        """The member; it numbers objects itself, whatever the masks call them."""
        return VoxelVoteSegmenter(self)


@dataclass(frozen=True, eq=False)
class CameraState:
    """One camera.

    background: None before it is known. images: that it will be learnt from. seen: frames so far.
    """

    background: Background | None = None
    images: tuple[UInt8[np.ndarray, "height width 3"], ...] = ()
    seen: int = 0


@dataclass(frozen=True, eq=False)
class VoxelVoteState:
    """volume: that the cameras monitor. cameras: what is known of each. objects: of the last frames. numbers: given."""

    volume: Volume
    cameras: tuple[CameraState, ...]
    objects: tuple[Known, ...] = ()
    numbers: int = 0


@dataclass(frozen=True, eq=False)
class _Moving:
    """One image: its difference from the background, and the weight of what moves."""

    image: Float32[np.ndarray, "height width 3"]
    seen: Difference
    weight: Float32[np.ndarray, "height width"]


@dataclass(frozen=True)
class VoxelVoteSegmenter:
    """Objects of several cameras at once: equal numbers in two cameras are one object."""

    config: VoxelVoteConfig

    def initial(self, cameras: Sequence[CaptureCamera], preview: Preview | None = None) -> VoxelVoteState:
        """Backgrounds from the preview; without one they are learnt from the first frames, which show nothing."""
        volume = monitored_volume(cameras, reach=self.config.vote.reach)
        empty = (CameraState(),) * len(cameras)
        if preview is None:
            return VoxelVoteState(volume, empty)
        images: list[list[np.ndarray]] = [[] for _ in cameras]
        for frames in preview(PREVIEWED, rgb=True, ids=False):
            for kept, image in zip(images, frames.rgb, strict=True):
                if image is not None:
                    kept.append(as_bytes(image))
        pairs = [previewed(one, self.config.background) if one else (None, one) for one in images]
        first, steady = [known for known, _ in pairs], [kept for _, kept in pairs]
        known = first
        for _ in range(RELEARNT):
            known = self._without_lingering(volume, known, first, steady)
        return VoxelVoteState(volume, tuple(CameraState(one) for one in known))

    def step(self, frames: FrameSet, state: VoxelVoteState) -> tuple[list[Silhouette], VoxelVoteState]:
        """Silhouettes of all objects that are believed, best known first, and the next state."""
        config = self.config
        moving = [self._moving(image, one) for image, one in zip(frames.rgb, state.cameras, strict=True)]
        sky = _sky([one.background for one in state.cameras])
        found = self._found(state.volume, moving, sky)
        changing, light = (
            [_changes(one, moving) for one in found],
            [_is_light(one, moving, sky, self.config.cue, below=state.volume.is_below(one.centre)) for one in found],
        )
        now, lost = linked(state.objects, found, changing, light, frames.time_s, state.numbers, config.objects)
        numbers = max([state.numbers, *(one.number for one in now)])
        lasting = [one.still is not None and one.still <= config.objects.still_after and not one.shadow for one in now]
        pairs = [(o, c) for o, c, lasts in zip(now, found, lasting, strict=True) if lasts]
        cameras = tuple(
            self._next(index, image, one, known, [candidate for _, candidate in pairs])
            for index, (image, one, known) in enumerate(zip(frames.rgb, moving, state.cameras, strict=True))
        )
        believed = sorted((pair for pair in pairs if pair[0].believed), key=lambda pair: -pair[0].found)
        masks = [
            one
            for known, candidate in believed
            for one in self._silhouettes(
                known.number, candidate, [c for _, c in pairs], moving, sky, state.volume.cameras
            )
        ]
        return masks, VoxelVoteState(state.volume, cameras, (*now, *lost), numbers)

    def _without_lingering(
        self,
        volume: Volume,
        known: Sequence[Background | None],
        first: Sequence[Background | None],
        images: Sequence[Sequence[UInt8[np.ndarray, "_ _ 3"]]],
    ) -> Sequence[Background | None]:
        """The first backgrounds without objects that stay, where all cameras recorded the same frames.

        Args:
            known: with which objects are looked for. What looks like other light in them may be an object that they
                show; below all cameras it is a shadow, whose place must keep its texture to be known as one.
            images: in the place and light of the first.
        """
        count = min(len(one) for one in images)
        if max(len(one) for one in images) > count or not count:
            return known
        outlines: list[dict[int, list[np.ndarray]]] = [{} for _ in images]
        sky = _sky(known)
        for frame in range(0, count, LOOKED_AT):
            moving = [self._steady(one[frame], k) for one, k in zip(images, known, strict=True)]
            found = [
                one
                for one in self._found(volume, moving, sky)
                if not (volume.is_below(one.centre) and _is_light(one, moving, sky, self.config.cue, below=True))
            ]
            for camera, kept in enumerate(outlines):
                regions = [r for candidate in found if (r := candidate.regions[camera]) is not None]
                kept[frame] = [hull for region in regions if (hull := outline_of(region)) is not None]
        return tuple(
            None if one is None else without_lingering(one, images, kept)
            for one, images, kept in zip(first, images, outlines, strict=True)
        )

    def _steady(self, image: UInt8[np.ndarray, "height width 3"], known: Background | None) -> _Moving | None:
        """What moves in an image that lies where the background does."""
        if known is None:
            return None
        floats = as_floats(image)
        seen = difference_at(STILL, floats, known, self.config.background)
        return _Moving(floats, seen, motion_weight(floats, seen, self.config.cue))

    def _found(self, volume: Volume, moving: Sequence[_Moving | None], sky: Sequence[Sky | None]) -> list[Candidate]:
        """What moves at one place, shadows with it."""
        weights, config = [None if one is None else one.weight for one in moving], self.config.vote
        return candidates(vote(volume, weights, config, sky), volume.cameras, weights, config)

    def _moving(self, image: Float32[np.ndarray, "height width 3"] | None, known: CameraState) -> _Moving | None:
        if image is None or known.background is None:
            return None
        seen = difference_of(image, known.background, self.config.background)
        return _Moving(image, seen, motion_weight(image, seen, self.config.cue))

    def _next(
        self,
        camera: int,
        image: Float32[np.ndarray, "height width 3"] | None,
        moving: _Moving | None,
        known: CameraState,
        objects: Sequence[Candidate],
    ) -> CameraState:
        """What is known of a camera after this frame."""
        if image is None:
            return known
        if moving is None or known.background is None:
            return self._warmed_up(image, known)
        background, seen = followed(image, moving.seen, known.background), known.seen + 1
        if (seen + camera) % EVERY:
            return CameraState(background, seen=seen)
        covered = np.zeros(moving.weight.shape, bool)
        for one in objects:
            region = one.regions[camera]
            if region is not None:
                wide = widened(region, covered.shape, AROUND)
                covered[wide.window] |= wide.inside
        return CameraState(after(image, moving.seen, background, covered, self.config.background), seen=seen)

    def _warmed_up(self, image: Float32[np.ndarray, "height width 3"], known: CameraState) -> CameraState:
        images = (*known.images, as_bytes(image)) if known.seen % KEPT_OF == 0 else known.images
        if known.seen + 1 < self.config.background.warm_up:
            return CameraState(None, images, known.seen + 1)
        return CameraState(learnt(images, self.config.background))

    def _silhouettes(
        self,
        number: int,
        one: Candidate,
        others: Sequence[Candidate],
        moving: Sequence[_Moving | None],
        sky: Sequence[Sky | None],
        cameras: Sequence[CaptureCamera],
    ) -> list[Silhouette]:
        """One object's silhouettes in all cameras that show it; what nearer objects hide is theirs, leaves are none."""
        found = []
        for index, (region, cue, camera) in enumerate(zip(one.regions, moving, cameras, strict=True)):
            if region is None or cue is None:
                continue
            place = camera.world_from_cam[:3, 3]
            depth = np.linalg.norm(one.centre - place)
            hiding = [c.regions[index] for c in others if c is not one and np.linalg.norm(c.centre - place) < depth]
            visible = without(region, [other for other in hiding if other is not None])
            coverage = coverage_of(visible, cue.seen, cue.weight, self.config.masks)
            found.append(silhouette_of(index, number, coverage))
        masks = [mask for mask in found if mask is not None]
        before_sky = [is_before(one.regions[mask.camera], sky[mask.camera], mask.coverage.shape) for mask in masks]
        return uncontradicted(one, masks, before_sky, cameras)


def _changes(one: Candidate, moving: Sequence[_Moving | None]) -> bool:
    """Whether at least two cameras see it change since the last frame; so it is believed where there was none."""
    changed = []
    for region, cue in zip(one.regions, moving, strict=True):
        if region is None or cue is None:
            continue
        recent = cue.seen.recent
        if recent is None:
            changed.append(True)
            continue
        window = region.window
        moved = (recent[window] > np.maximum(CHANGES, 3 * cue.seen.deviation[window])) & region.inside
        changed.append(int(np.count_nonzero(moved)) >= FEWEST_CHANGED)
    return sum(changed) >= 2


def _sky(backgrounds: Sequence[Background | None]) -> tuple[Sky | None, ...]:
    return open_sky([None if one is None else one.grey for one in backgrounds])


def _is_light(
    one: Candidate,
    moving: Sequence[_Moving | None],
    sky: Sequence[Sky | None],
    config: CueConfig,
    *,
    below: bool,
) -> bool:
    """Whether cameras see the background itself there, in other light: a cast shadow meets on the ground.

    Not most of them have to say so: where they look flat along the ground, little of a shadow is left but its rim.
    Nothing casts a shadow on the sky. What moves before it in two images is none, whatever leaves do in the others; but
    what lies `below` all cameras is before the ground, however bright that is.
    Where no camera sees a texture, a shadow is what darkens the ground alike in all its pixels and in most images.
    """
    seen = [(r, m, s) for r, m, s in zip(one.regions, moving, sky, strict=True) if r is not None and m is not None]
    before_sky = [is_before(region, s, cue.weight.shape) for region, cue, s in seen]
    moves = [float((cue.weight[region.window] * region.inside).sum()) >= FEWEST_CHANGED for region, cue, _ in seen]
    if np.count_nonzero(np.logical_and(before_sky, moves)) >= 2 and not below:
        return False
    on_something = [
        (region, cue, moved)
        for (region, cue, _), beside, moved in zip(seen, before_sky, moves, strict=True)
        if below or not beside
    ]
    said = [unlike_background(cue.image, cue.seen, region, config) for region, cue, _ in on_something]
    said = [unlike for unlike in said if unlike is not None]
    if said:
        return float(np.quantile(said, SAYING)) < UNLIKE
    return _is_darkened([(region, cue) for region, cue, moved in on_something if moved])


def _is_darkened(moves: Sequence[tuple[Region, _Moving]]) -> bool:
    """Whether at least two of the cameras in which it moves, and half of them, see one and the same darkening.

    The same ground is seen by all of them; behind an object each sees another place, and the object from another side.
    """
    gains = [common_gain(cue.image, cue.seen, region) for region, cue in moves]
    known = [gain for gain in gains if gain is not None]
    if len(known) < max(2, 0.5 * len(moves)):
        return False
    return float(np.ptp(np.stack(known), axis=0).max()) <= SAME_GAIN
