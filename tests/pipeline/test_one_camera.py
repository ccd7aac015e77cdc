"""One camera alone shows the object: an answer without a place, as long as no frame shows it to several."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.known_answers import Heights
from support.networks import frame_sets, network
from support.written_networks import write_network

from aerojax.capture.format import Capture
from aerojax.classify.base import Classifier, untrained, untrained_card
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.views.config import ViewsConfig
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.clips import load_clip
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.pipeline.clips import ClipsConfig, _Job, _make_clip
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.events import Dropped, OneCamera, Updated
from aerojax.pipeline.exports.export import export_clip
from aerojax.pipeline.offline import reconstruct_capture
from aerojax.pipeline.results import headline, result_of, result_schema
from aerojax.pipeline.step import make_pipeline
from aerojax.pipeline.stream import stream
from aerojax.pipeline.trust import Record, TrustConfig, judge
from aerojax.reconstruct.disagreement import Disagreement
from aerojax.reconstruct.hull import HullConfig
from aerojax.serve.messages import Teller, message_schema

SMALL = PipelineConfig(
    reconstruct=HullConfig(grid=32, capacity=512),
    crop_size=64,
    view_size=16,
    decimation=DecimationConfig(512, 96, 64),
    lost_after=3,
)
KEY = jax.random.key(0)
CAMERAS = network()
ALONE = 1


@pytest.fixture(scope="module")
def classifier() -> Classifier:
    config = ViewsConfig(width=8, hidden=8, view_width=8, d_model=16, layers=1)
    return untrained(config, tokens=8, frames=8, key=jax.random.key(3))


def seen_by(*watching: int, frames: range):
    return list(frame_sets(CAMERAS, frames, watching=watching))


def run(classifier, frames):
    steps = list(stream(make_pipeline(CAMERAS, SMALL, classifier, key=KEY), frames))
    return [event for events, _ in steps for event in events], steps[-1][1].objects


def by_one(events) -> list[OneCamera]:
    return [event.one_camera for event in events if isinstance(event, Dropped) and event.one_camera is not None]


def test_one_camera_gives_an_answer_without_a_place(classifier, tmp_path):
    capture = write_network(tmp_path / "capture", 4, watching=(ALONE,))
    clip = reconstruct_capture(capture, SMALL, classifier, key=KEY, keep_observations=True)
    assert clip.frames == () == clip.observations and clip.position.shape == (0, 3)
    assert {frame: one.camera for frame, one in clip.one_camera.items()} == dict.fromkeys(range(4), ALONE)
    assert clip.gaussians.mean.shape == (4, 0, 3) and clip.answer_set is None
    result = json.loads(json.dumps(result_of(capture, clip)))
    assert (result["status"], result["label"], result["track"]) == ("unsure", None, [])
    assert result["one_camera"] == dict.fromkeys("0123", "cam_02") and result["familiarity"] is None
    assert result["most_likely"] in CLASSES and sum(result["probabilities"].values()) == pytest.approx(1.0, abs=1e-5)
    assert "one-camera" in [reason["code"] for reason in result["reasons"]]
    (warning,) = result["warnings"]
    assert "4 of 4 frames" in warning and "cam_02" in warning and "no place" in warning
    assert headline(result).startswith("not sure") and set(result["dropped"]) == set("0123")
    assert export_clip(capture, clip, ("ply", "csv", "coco"), tmp_path / "out") == {}
    schema = pytest.importorskip("jsonschema", reason="jsonschema comes with requirements.clients.lock")
    schema.validate(result, result_schema(), cls=schema.Draft202012Validator)


def test_a_stream_says_the_same_of_the_same_crops(classifier, tmp_path):
    clip = reconstruct_capture(write_network(tmp_path, 4, watching=(ALONE,)), SMALL, classifier, key=KEY)
    events, objects = run(classifier, seen_by(ALONE, frames=range(4)))
    said = by_one(events)
    np.testing.assert_allclose(np.stack([one.log_probabilities for one in said]), clip.log_probabilities, atol=1e-6)
    at_once = jax.jit(lambda c, s: c.clip(s, jnp.ones(4, bool)))(classifier, clip.seen)
    np.testing.assert_allclose(at_once, clip.log_probabilities, atol=1e-5)
    everybody = [
        event for event in run(classifier, list(frame_sets(CAMERAS, range(4))))[0] if isinstance(event, Updated)
    ]
    for one, all_of_them in zip(said, everybody, strict=True):
        assert one.seen.crops is not None and all_of_them.seen.crops is not None
        np.testing.assert_array_equal(one.seen.crops.valid, [False, True, False, False])
        np.testing.assert_array_equal(one.seen.crops.rgba[ALONE], all_of_them.seen.crops.rgba[ALONE])
    assert objects[0].record.one_camera == 4 and objects[0].one_camera is not None


def test_from_the_first_place_on_the_answer_is_that_of_several(classifier):
    several = seen_by(0, 2, frames=range(3, 6))
    both, objects = run(classifier, [*seen_by(ALONE, frames=range(3)), *several, *seen_by(ALONE, frames=range(6, 8))])
    assert [type(event).__name__ for event in both[1:]] == ["Dropped"] * 3 + ["Updated"] * 3 + ["Dropped"] * 2
    assert len(by_one(both)) == 3 and all(event.one_camera is None for event in both[-2:])
    assert objects[0].one_camera is None and objects[0].record.one_camera == 0
    fresh, _ = run(classifier, several)
    for one, other in zip(both[4:7], fresh[1:], strict=True):
        np.testing.assert_array_equal(one.log_probabilities, other.log_probabilities)
        np.testing.assert_array_equal(one.position, other.position)


def test_a_capture_with_a_place_is_answered_from_its_places_alone(classifier, tmp_path):
    capture = write_network(tmp_path, 3, watching=(0, ALONE))
    clip = reconstruct_capture(capture, SMALL, classifier, key=KEY)
    assert clip.frames == (0, 1, 2) and clip.one_camera == {} and clip.warnings == ()
    assert result_of(capture, clip)["one_camera"] is None


@pytest.mark.parametrize("watching", [(), (ALONE,)])
def test_without_a_view_or_a_reader_of_crops_there_is_no_answer(watching, tmp_path):
    reader = Heights(untrained_card(MambaSplatConfig(), tokens=8, frames=2))
    capture = write_network(tmp_path, 2, watching=watching)
    for given in (reader, None) if watching == () else (reader,):
        with pytest.raises(UserError) as caught:
            reconstruct_capture(capture, SMALL, given, key=KEY)
        assert caught.value.code in ("no-usable-frames", "object-absent")


def test_few_frames_of_one_camera_are_insufficient():
    record, sure = Record.none(4).by_one_camera(30.0).by_one_camera(30.0), np.log(np.float32([0.97, 0.01, 0.01, 0.01]))
    found = judge(record, CAMERAS, sure, TrustConfig())
    assert found.status == "insufficient" and [r.code for r in found.reasons] == ["few-frames", "one-camera"]
    three = record.by_one_camera(30.0)
    assert judge(three, CAMERAS, sure, TrustConfig(), familiarity=None).status == "unsure"
    hidden = replace(three, unusable=7)
    assert [r.code for r in judge(hidden, CAMERAS, sure, TrustConfig()).reasons] == ["frames-dropped", "one-camera"]
    small = judge(replace(three, width_px=3 * 7.5), CAMERAS, sure, TrustConfig())
    assert small.status == "insufficient" and [r.code for r in small.reasons] == ["too-small", "one-camera"]
    assert small.reasons[0].text == "it is 7.5 pixels wide there, 8 are needed"
    placed = replace(Record.none(4), used=3, sums=replace(Disagreement.none(4), frames=3))
    assert (three + placed).one_camera == 0 and (three + record).one_camera == 5
    assert (three + placed).width_px == 0.0 and (three + record).width_px == 150.0


def test_a_service_says_what_one_camera_shows(classifier):
    events, objects = run(classifier, seen_by(ALONE, frames=range(2)))
    teller = Teller(Capture(Path("site"), 30.0, 1, CAMERAS, None), np.eye(4), TrustConfig())
    told = [
        one for one in teller.events(events, objects, 0.1, datetime(2026, 5, 1, tzinfo=UTC)) if isinstance(one, dict)
    ]
    assert [one["type"] for one in told] == ["appeared", "unusable", "unusable"] and "position" not in told[2]
    said = told[2]["one_camera"]
    assert said["camera"] == "cam_02" and said["status"] == "insufficient" and len(said["box"]) == 4
    assert said["most_likely"] == max(said["probabilities"], key=said["probabilities"].get)
    schema = pytest.importorskip("jsonschema", reason="jsonschema comes with requirements.clients.lock")
    schema.validate(json.loads(json.dumps(told[2])), message_schema(), cls=schema.Draft202012Validator)


def test_its_clip_has_crops_alone_and_lies_apart(tmp_path):
    write_network(tmp_path / "capture", 3, watching=(ALONE,), instance=1)
    path = tmp_path / "rig" / "test" / "one.npz"
    config = ClipsConfig(0, 16, SMALL)
    assert _make_clip(_Job(tmp_path / "capture", "rig", "bird", "one", config, path)) is None and not path.exists()
    clip = load_clip(path.parent / "one_camera" / "one.npz")
    assert clip.columns.shape == (3, 0, 14) and clip.crops is not None and clip.crops.shape == (3, 4, 16, 16, 4)
    assert clip.crop_valid is not None and clip.crop_valid.sum(axis=0).tolist() == [0, 3, 0, 0]
    assert clip.facts["one_camera"] is True and clip.facts["cameras"] == 4 and "distance_m" not in clip.facts
