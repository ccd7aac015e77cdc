"""The frame step: events, the fold, members from outside, and equal numbers for streams and whole captures."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, replace
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.cut_views import aimed_aside
from support.networks import frame_sets, network, position_at

import aerojax.reconstruct.members
import aerojax.segment.members
import aerojax.track.members
from aerojax.capture.format import read_capture
from aerojax.classify.base import Classifier, untrained
from aerojax.classify.familiarity import Familiarity
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.views.config import ViewsConfig
from aerojax.core.config import to_dataclass, to_mapping
from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians, Track
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.gaussians.rotate import transform
from aerojax.pipeline.config import PipelineConfig, clip_settings
from aerojax.pipeline.events import Appeared, Dropped, Lost, Updated
from aerojax.pipeline.offline import reconstruct_capture
from aerojax.pipeline.source import capture_frames, capture_preview
from aerojax.pipeline.step import Pipeline, make_pipeline
from aerojax.pipeline.stream import stream
from aerojax.pipeline.warnings import cut_warnings, shift_warnings
from aerojax.reconstruct.base import ReconstructorConfig
from aerojax.reconstruct.disagreement import Disagreement
from aerojax.reconstruct.hull import HullConfig
from aerojax.segment.base import SegmenterConfig
from aerojax.segment.given import GivenSegmenter
from aerojax.track.base import TrackerConfig

SMALL = PipelineConfig(
    reconstruct=HullConfig(grid=32, capacity=512), crop_size=64, decimation=DecimationConfig(512, 96, 64), lost_after=3
)
NETWORK = MambaSplatConfig(d_model=32, depth=1, mamba_layers=2, scale_normalisation="running")
KEY = jax.random.key(0)


@pytest.fixture(scope="module")
def classifier() -> Classifier:
    return untrained(NETWORK, tokens=32, frames=8, key=jax.random.key(1))


def run(pipeline: Pipeline, source) -> list:
    return [event for events, _ in stream(pipeline, source) for event in events]


def test_an_object_appears_moves_is_dropped_lost_and_appears_again(classifier):
    cameras = network()
    events = run(
        make_pipeline(cameras, SMALL, classifier, key=KEY), frame_sets(cameras, range(12), blind=(3, 4, 5, 6, 7))
    )
    said = [(type(event).__name__, event.frame) for event in events]
    dropped = [("Dropped", frame) for frame in (3, 4, 5)]
    assert said[:5] == [("Appeared", 0), ("Updated", 0), ("Updated", 1), ("Updated", 2), dropped[0]]
    assert ("Lost", 6) in said and said.count(("Appeared", 8)) == 1 and said[-1] == ("Updated", 11)
    reasons = {event.code for event in events if isinstance(event, Dropped)}
    assert reasons == {"too-few-views"}
    for event in events:
        if isinstance(event, Updated):
            np.testing.assert_allclose(event.position, position_at(event.frame), atol=0.03)
            assert event.log_probabilities is not None
            assert np.exp(event.log_probabilities).sum() == pytest.approx(1.0, abs=1e-5)
    assert not any(isinstance(event, Lost) and event.frame < 6 for event in events)


def turned_network(degrees: float):
    """Cameras as they are, and as they are stated: the second one turned."""
    cameras = network()
    pose = cameras[1].world_from_cam.copy()
    pose[:3, :3] = Rotation.from_euler("y", degrees, degrees=True).as_matrix() @ pose[:3, :3]
    return cameras, (cameras[0], replace(cameras[1], world_from_cam=pose), *cameras[2:])


def test_silhouettes_that_meet_in_no_way_are_a_dropped_frame():
    cameras, backwards = network(), np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL axes
    stated = [replace(camera, world_from_cam=camera.world_from_cam @ backwards) for camera in cameras]
    events = run(make_pipeline(stated, SMALL, key=KEY), frame_sets(cameras, range(1)))
    assert [type(event) for event in events] == [Appeared, Dropped]
    assert events[1].code == "silhouettes-disjoint" and "calibration" in events[1].text


def test_silhouettes_that_meet_when_shifted_are_used_and_it_is_said():
    cameras, stated = turned_network(10)
    frames = list(frame_sets(cameras, range(4)))
    events = run(make_pipeline(stated, SMALL, key=KEY), frames)
    shifted = [event for event in events if isinstance(event, Updated)]
    assert len(shifted) == 4 and all(0.1 < event.shift_m < 1.0 for event in shifted)
    (text,) = shift_warnings(shifted, 4)
    assert text.startswith("4 of 4 frames") and "calibration" in text
    right = [event for event in run(make_pipeline(cameras, SMALL, key=KEY), frames) if isinstance(event, Updated)]
    assert not any(event.shift_m for event in right) and shift_warnings(right, 4) == ()
    sizes = [np.ptp(np.asarray(event.gaussians.mean), axis=0) for event in (*shifted, *right)]
    np.testing.assert_allclose(np.sort(sizes[0]), np.sort(sizes[4]), atol=0.1)


def test_cameras_that_cut_the_object_are_used_and_it_is_said(monkeypatch):
    cameras = aimed_aside(network(), 2, 50)
    frames = list(frame_sets(cameras, range(6, 16, 3)))

    def updates():
        return [event for event in run(make_pipeline(cameras, SMALL, key=KEY), frames) if isinstance(event, Updated)]

    used = updates()
    monkeypatch.setattr(HullConfig, "reads_known", False)
    left_out = updates()
    cut = [event.cut == (2,) for event in used]
    assert cut == [False, False, True, True] and not any(event.cut for event in left_out)
    for one, other, part in zip(used, left_out, cut, strict=True):
        assert one.observation is not None and one.observation.valid[2] and one.seen.crops is not None
        assert part != np.asarray(one.seen.crops.valid)[2]
        same = [np.array_equal(a, b) for a, b in zip(*map(jax.tree.leaves, (one.seen, other.seen)), strict=True)]
        assert all(same) != part  # without a cut view the answer is the same to the bit
        np.testing.assert_array_equal(one.position, other.position)
        assert np.isnan(one.consistency.ray_m[2]) == part and np.isfinite(one.consistency.uncovered[2])
    (text,) = cut_warnings(used, cameras, 4)
    assert text == f"{sum(cut)} of 4 frames use cameras whose border cuts the object: cam_03"
    assert cut_warnings(left_out, cameras, 4) == ()


def test_one_camera_that_shows_the_whole_object_is_enough_with_those_that_cut_it(monkeypatch):
    cameras = network()
    for camera, column in ((1, 42), (2, 76), (3, 110)):
        cameras = aimed_aside(cameras, camera, column)
    frames = list(frame_sets(cameras, range(4, 5)))
    appeared, seen = run(make_pipeline(cameras, SMALL, key=KEY), frames)
    assert isinstance(appeared, Appeared) and isinstance(seen, Updated) and seen.cut == (1, 2, 3)
    assert np.linalg.norm(seen.position - position_at(4)) < 0.3
    in_world = transform(seen.gaussians, jnp.asarray(cameras[0].world_from_cam, jnp.float32)).mean
    assert np.linalg.norm(np.asarray(in_world) - position_at(4)[None], axis=1).max() < 0.8
    assert seen.seen.crops is not None
    np.testing.assert_array_equal(seen.seen.crops.valid, [True, False, False, False])  # classifiers read whole objects
    assert np.isnan(seen.consistency.shift_m).all() and np.isfinite(seen.consistency.uncovered).all()
    assert Disagreement.of(seen.consistency, None).rows == 0
    monkeypatch.setattr(HullConfig, "reads_known", False)
    assert isinstance(run(make_pipeline(cameras, SMALL, key=KEY), frames)[1], Dropped)


def test_the_world_s_place_and_turn_change_nothing(classifier):
    place = np.eye(4)
    place[:3, :3] = Rotation.random(random_state=3).as_matrix()
    place[:3, 3] = [4.5e5, 5.6e6, 120.0]  # as in UTM coordinates
    here, there = network(), network(world_from_rig=place)
    frames = list(frame_sets(here, range(4)))
    one, other = (
        [e for e in run(make_pipeline(c, SMALL, classifier, key=KEY), frames) if isinstance(e, Updated)]
        for c in (here, there)
    )
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(b.log_probabilities, a.log_probabilities, atol=1e-4)
        np.testing.assert_allclose(b.position, place[:3, :3] @ a.position + place[:3, 3], atol=1e-5)


def test_a_stream_goes_on_where_it_ended(classifier):
    cameras = network()
    pipeline = make_pipeline(cameras, SMALL, classifier, key=KEY)
    whole = [e for e in run(pipeline, frame_sets(cameras, range(6))) if isinstance(e, Updated)]
    *_, (_, state) = stream(pipeline, frame_sets(cameras, range(3)))
    rest = [e for es, _ in stream(pipeline, frame_sets(cameras, range(3, 6)), state) for e in es]
    np.testing.assert_array_equal(rest[-1].log_probabilities, whole[-1].log_probabilities)
    fresh = [e for es, _ in stream(pipeline, frame_sets(cameras, range(3, 6))) for e in es]
    assert np.abs(fresh[-1].log_probabilities - whole[-1].log_probabilities).max() > 1e-6  # the state matters


def test_the_state_does_not_grow(classifier):
    cameras = network(3)
    pipeline = make_pipeline(cameras, SMALL, classifier, key=KEY)
    sizes = []
    for _, state in stream(pipeline, frame_sets(cameras, range(5))):
        leaves = jax.tree.leaves([one.classify for one in state.objects.values()])
        sizes.append(sum(leaf.nbytes for leaf in leaves))
    assert len(set(sizes)) == 1


@pytest.mark.slow
def test_a_stream_equals_the_whole_capture_frame_by_frame(shared, classifier):
    folder = shared / "data/captures/drone_crazyflie"
    if not folder.is_dir():
        pytest.skip(f"no capture at {folder}")
    capture = replace(read_capture(folder), frames=10)
    clip = reconstruct_capture(capture, SMALL, classifier, key=KEY)
    pipeline = make_pipeline(capture.cameras, SMALL, classifier, key=KEY)
    events = [
        e
        for es, _ in stream(pipeline, capture_frames(capture), pipeline.initial(capture_preview(capture)))
        for e in es
        if isinstance(e, Updated)
    ]
    assert tuple(e.frame for e in events) == clip.frames and len(clip.frames) >= 8
    np.testing.assert_allclose(np.stack([e.log_probabilities for e in events]), clip.log_probabilities, atol=1e-5)
    # And with the parallel scan over the whole clip, which never saw a stream's state.
    at_once = classifier.clip(clip.seen, jnp.ones(len(clip.frames), bool))
    np.testing.assert_allclose(at_once, clip.log_probabilities, atol=1e-5)


def test_a_pipeline_that_contradicts_the_card_is_refused(classifier):
    settings = tuple(sorted(clip_settings(SMALL).items()))
    carded = dataclasses.replace(classifier, card=dataclasses.replace(classifier.card, settings=settings))
    make_pipeline(network(), SMALL, carded, key=KEY)
    with pytest.raises(UserError, match=r"crop_size is 32, in training it was 64") as caught:
        make_pipeline(network(), replace(SMALL, crop_size=32), carded, key=KEY)
    assert caught.value.code == "mismatch"
    with pytest.raises(UserError, match=r"reconstruct\.grid"):
        make_pipeline(network(), replace(SMALL, reconstruct=HullConfig(grid=48, capacity=512)), carded, key=KEY)
    chairs = dataclasses.replace(
        carded, card=dataclasses.replace(carded.card, classes=("bed", "chair", "desk", "sofa"))
    )
    with pytest.raises(UserError, match="tells bed, chair, desk, sofa apart"):
        make_pipeline(network(), SMALL, chairs, key=KEY)


# Members that nobody here wrote: each is a configuration with a name, and what it builds.


@dataclass(frozen=True)
class Ball(ReconstructorConfig):
    name: Literal["ball"] = "ball"
    radius: float = 0.25

    def build(self):
        cloud = jax.random.normal(KEY, (64, 14)).at[:, 10].set(0.9) * self.radius
        return jax.tree_util.Partial(lambda cloud, views, valid: (Gaussians.from_columns(cloud), jnp.array(64)), cloud)


@dataclass(frozen=True)
class Inverse(SegmenterConfig):
    name: Literal["inverse"] = "inverse"

    def build(self, object_id):
        return GivenSegmenter(3)


@dataclass(frozen=True)
class Second(TrackerConfig):
    name: Literal["second"] = "second"

    def build(self):
        return self

    def initial(self, cameras):
        return len(cameras)

    def step(self, frames, silhouettes, state):
        seen = {one.camera: one for one in silhouettes}
        return [Track(2, tuple(seen.get(c) for c in range(state)), None, None, None)], state


@pytest.mark.parametrize(
    ("room", "member"),
    [(aerojax.reconstruct, Ball), (aerojax.segment, Inverse), (aerojax.track, Second)],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_member_from_outside_is_chosen_by_its_name(room, member, monkeypatch):
    name, door = member.name, room.__name__.rpartition(".")[2]
    monkeypatch.setitem(room.members.MEMBERS, name, member)
    config = to_dataclass({**to_mapping(SMALL), door: {"name": name}}, PipelineConfig)
    cameras = network()
    events = run(make_pipeline(cameras, config, key=KEY), frame_sets(cameras, range(2)))
    assert getattr(config, door) == member() and sum(isinstance(e, Updated) for e in events) == 2
    assert {e.track for e in events} == {2 if member is Second else 0}


def test_an_unknown_member_is_named_with_those_known():
    with pytest.raises(UserError, match=r"reconstruct.*ball.*hull"):
        to_dataclass({**to_mapping(SMALL), "reconstruct": {"name": "ball"}}, PipelineConfig)


def views_with_familiarity(most):
    """A classifier of views, and a familiarity whose known objects are at these distances after every frame."""
    config = ViewsConfig(width=8, hidden=8, view_width=8, d_model=16, layers=1)
    classifier = untrained(config, tokens=8, frames=8, key=jax.random.key(3))
    known = jnp.linspace(*most, 9)[None]
    return classifier, Familiarity(
        jnp.zeros((2, 4, 16)), jnp.stack([jnp.eye(16)] * 2), jnp.ones(2) / 2, known, jnp.zeros(0), jnp.zeros(1)
    )


def test_familiarity_of_a_stream_is_that_of_its_clip():
    cameras, (classifier, familiarity) = network(), views_with_familiarity((-3.0, 6.0))
    pipeline = make_pipeline(cameras, replace(SMALL, view_size=16), classifier, key=KEY, familiarity=familiarity)
    found = [event for event in run(pipeline, frame_sets(cameras, range(5), blind=(2,))) if isinstance(event, Updated)]
    seen = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(event.seen for event in found))
    logits, features = jax.jit(lambda c, s: c.clip_features(s, jnp.ones(4, bool)))(classifier, seen)
    shares = [float(familiarity.share(row, 1 + t)) for t, row in enumerate(features)]
    assert [event.familiarity for event in found] == pytest.approx(shares) and 0 < min(shares) < 1
    for one, row in zip(found, logits, strict=True):
        np.testing.assert_allclose(one.log_probabilities, row, atol=1e-5)


def test_a_classifier_without_features_knows_nothing_strange(classifier):
    familiarity = views_with_familiarity((0.0, 1.0))[1]
    with pytest.raises(UserError, match="gives no features"):
        make_pipeline(network(), SMALL, classifier, key=KEY, familiarity=familiarity)
