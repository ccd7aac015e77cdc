"""The verdict: what makes an answer unsure or insufficient, and what it says; streams and captures agree."""

from __future__ import annotations

from dataclasses import replace

import jax
import numpy as np
import pytest
from support.disagreeing_cameras import late, turned
from support.networks import frame_sets, network

from aerojax.gaussians.decimate import DecimationConfig
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.events import Dropped, Updated
from aerojax.pipeline.step import make_pipeline
from aerojax.pipeline.stream import stream
from aerojax.pipeline.trust import Record, TrustConfig, judge
from aerojax.reconstruct.disagreement import Disagreement
from aerojax.reconstruct.hull import HullConfig

SMALL = PipelineConfig(
    reconstruct=HullConfig(grid=32, capacity=512), crop_size=64, decimation=DecimationConfig(512, 96, 64), lost_after=3
)
CAMERAS = network()
FRAMES = list(frame_sets(CAMERAS, range(14)))
SURE = np.log(np.array([0.9, 0.05, 0.03, 0.02], np.float32))
TRUST = TrustConfig()
SEEN = Record(10, 0, Disagreement.none(4))


def run(cameras, frames):
    """Events, and the record after the last frame."""
    steps = list(stream(make_pipeline(cameras, SMALL, key=jax.random.key(0)), frames))
    return [event for events, _ in steps for event in events], steps[-1][1].objects[0].record


def test_enough_frames_agreement_and_probability_are_ok():
    found = judge(SEEN, CAMERAS, SURE, TRUST)
    assert (found.status, found.reasons, found.suspect) == ("ok", (), None)
    assert judge(SEEN, CAMERAS, None, TRUST).status == "ok"


@pytest.mark.parametrize(
    ("record", "chances", "status", "code", "words"),
    [
        (replace(SEEN, used=2), SURE, "insufficient", "few-frames", "2 usable frame(s), 3 are needed"),
        (replace(SEEN, used=4, unusable=5), SURE, "insufficient", "frames-dropped", "only 4 of the 9 frames"),
        (SEEN, np.log(np.float32([0.4, 0.3, 0.2, 0.1])), "unsure", "low-probability", "0.40, less than 0.5"),
    ],
)
def test_what_is_missing_is_said(record, chances, status, code, words):
    found = judge(record, CAMERAS, chances, TRUST)
    assert found.status == status and [reason.code for reason in found.reasons] == [code]
    assert words in found.reasons[0].text


def test_what_is_unfamiliar_is_unknown_and_that_is_an_answer():
    found = judge(SEEN, CAMERAS, SURE, TRUST, familiarity=0.004)
    assert (found.status, found.unknown, found.familiarity) == ("ok", True, 0.004)
    assert [reason.code for reason in found.reasons] == ["unfamiliar"]
    assert "no more than 0.4% of known objects look as strange" in found.reasons[0].text
    familiar = judge(SEEN, CAMERAS, SURE, TRUST, familiarity=0.05)
    assert (familiar.status, familiar.unknown, familiar.reasons) == ("ok", False, ())
    assert not judge(SEEN, CAMERAS, SURE, replace(TRUST, least_familiarity=0.0), familiarity=0.004).unknown


def test_an_unknown_object_needs_no_probable_class_but_frames_and_cameras():
    doubtful = np.log(np.float32([0.4, 0.3, 0.2, 0.1]))
    alone = judge(SEEN, CAMERAS, doubtful, TRUST, familiarity=0.004)
    assert alone.status == "ok" and [reason.code for reason in alone.reasons] == ["unfamiliar"]
    known = judge(SEEN, CAMERAS, doubtful, TRUST, familiarity=0.5)
    assert known.status == "unsure" and [reason.code for reason in known.reasons] == ["low-probability"]
    short = judge(replace(SEEN, used=2), CAMERAS, SURE, TRUST, familiarity=0.004)
    assert short.status == "insufficient" and [r.code for r in short.reasons] == ["few-frames", "unfamiliar"]
    cameras = turned(CAMERAS, 1, (1.2, -1.6, 0.0))
    strange = judge(run(cameras, FRAMES)[1], cameras, SURE, TRUST, familiarity=0.004)
    assert strange.status == "unsure" and [r.code for r in strange.reasons] == ["cameras-disagree", "unfamiliar"]


def test_two_cameras_are_believed_less():
    def verdict(cameras: int, trust: TrustConfig = TRUST):
        nothing = [np.zeros_like(FRAMES[0].ids[0])] * (4 - cameras)
        blind = [replace(f, ids=(*f.ids[:cameras], *nothing)) for f in FRAMES]
        events, record = run(CAMERAS, blind)
        assert sum(isinstance(event, Updated) for event in events) == len(FRAMES)
        return judge(record, CAMERAS, SURE, trust)

    found = verdict(2)
    assert found.status == "unsure" and [reason.code for reason in found.reasons] == ["few-views"]
    assert found.reasons[0].text.startswith("2.0 cameras a frame")
    assert verdict(3).status == verdict(2, replace(TRUST, least_views=2.0)).status == "ok"


def test_thresholds_are_those_of_the_configuration():
    assert judge(replace(SEEN, used=2), CAMERAS, SURE, replace(TRUST, least_frames=2)).status == "ok"
    assert judge(replace(SEEN, used=4, unusable=5), CAMERAS, SURE, replace(TRUST, least_share=0.4)).status == "ok"
    assert judge(SEEN, CAMERAS, SURE, replace(TRUST, least_probability=0.95)).status == "unsure"


def test_good_cameras_are_ok():
    events, record = run(CAMERAS, FRAMES)
    assert judge(record, CAMERAS, SURE, TRUST).status == "ok" and record.used == 14
    seen = [event.consistency for event in events if isinstance(event, Updated)]
    assert len(seen) == 14 and all((one.uncovered < 0.15).all() and (one.shift_px < 0.5).all() for one in seen)


def test_a_turned_camera_is_named():
    cameras = turned(CAMERAS, 1, (1.2, -1.6, 0.0))
    _, record = run(cameras, FRAMES)
    found = judge(record, cameras, SURE, TRUST)
    assert found.status == "unsure" and [reason.code for reason in found.reasons] == ["cameras-disagree"]
    assert found.suspect is not None and found.suspect.camera == 1 and found.suspect.cause == "turn"
    text = found.reasons[0].text
    assert text.startswith("camera cam_02 disagrees with the others by 0.") and "it is turned by about" in text
    assert judge(record, cameras, SURE, replace(TRUST, most_disagreement=50.0, most_offset=1.0)).status == "ok"
    assert judge(record, cameras, SURE, replace(TRUST, most_disagreement=50.0)).status == "unsure"


def test_frames_whose_silhouettes_do_not_meet_tell_of_the_clock():
    events, record = run(CAMERAS, late(FRAMES, 2, 6))
    found = judge(record, CAMERAS, None, TRUST, fps=30.0)
    dropped = [event for event in events if isinstance(event, Dropped)]
    assert all(event.consistency is not None for event in dropped) and record.unusable == len(dropped)
    assert found.suspect is not None and found.suspect.camera == 2
    text = next(reason.text for reason in found.reasons if reason.code == "cameras-disagree")
    assert "camera cam_03" in text and "clock" in text and "frames, late" in text


def test_a_stream_that_is_interrupted_judges_alike():
    cameras = turned(CAMERAS, 1, (1.0, 0.0, 0.0))
    pipeline = make_pipeline(cameras, SMALL, key=jax.random.key(0))
    *_, (_, whole) = stream(pipeline, FRAMES)
    *_, (_, first) = stream(pipeline, FRAMES[:5])
    *_, (_, second) = stream(pipeline, FRAMES[5:], first)
    a, b = (judge(state.objects[0].record, cameras, SURE, TRUST) for state in (whole, second))
    assert a == b
    assert len(whole.objects[0].record.path) == len(first.objects[0].record.path) == 5  # bounded


def test_records_before_and_after_a_loss_add_up():
    _, early = run(CAMERAS, FRAMES[:4])
    _, rest = run(CAMERAS, FRAMES[6:9])
    both = early + rest
    assert (both.used, both.sums.frames, both.path) == (7, 7, rest.path)
