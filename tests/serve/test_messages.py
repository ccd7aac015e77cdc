"""Every kind of message fits the schema that the package ships, and says what happened."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from support.networks import network

from aerojax.capture.format import Capture
from aerojax.pipeline.events import Appeared, Dropped, Lost
from aerojax.pipeline.trust import TrustConfig
from aerojax.serve.figures import Figures
from aerojax.serve.intake import CameraCount
from aerojax.serve.messages import SCHEMA, Teller, health_message, message, message_schema
from aerojax.serve.notices import CameraBack, CameraSilent, CamerasLacking, FramesDropped, SourceFailed

MOMENT = datetime(2026, 5, 1, 12, 0, 0, 123456, UTC)


@pytest.fixture
def teller() -> Teller:
    return Teller(Capture(Path("site"), 30.0, 1, network(4), None), np.eye(4), TrustConfig())


def fits(told: dict) -> dict:
    schema = pytest.importorskip("jsonschema", reason="jsonschema comes with requirements.clients.lock")
    schema.validate(json.loads(json.dumps(told)), message_schema(), cls=schema.Draft202012Validator)
    return told


@pytest.mark.parametrize(
    ("notice", "said"),
    [
        (CameraSilent(1, 3.25), {"type": "camera", "camera": "cam_02", "state": "silent"}),
        (CameraBack(0), {"type": "camera", "camera": "cam_01", "state": "back"}),
        (SourceFailed(None, "no disk", 2.0), {"type": "camera", "camera": None, "state": "failed", "retry_s": 2.0}),
        (CamerasLacking(2, 3), {"type": "lacking", "cameras": 2, "needed": 3}),
        (FramesDropped(4, 9), {"type": "dropped", "frames": 4, "total": 9}),
    ],
)
def test_notices_become_messages(teller, notice, said):
    told = fits(teller.notice(notice, MOMENT))
    assert told["time"] == "2026-05-01T12:00:00.123Z" and (told["format"], told["version"]) == ("aerojax-live", 1)
    assert {key: told[key] for key in said} == said


def test_events_become_messages_and_an_empty_sky_none(teller):
    events = [Appeared(7, 2), Dropped(7, 2, "too-few-views", "why"), Dropped(7, None, "too-few-views", "x"), Lost(7, 1)]
    told = [fits(one) for one in teller.events(events, {}, 0.7, MOMENT)]
    assert [(one["type"], one["track"], one["frame"]) for one in told] == [
        ("appeared", 2, 7),
        ("unusable", 2, 7),
        ("lost", 1, 7),
    ]
    assert told[1]["code"] == "too-few-views" and told[1]["text"] == "why"


def test_figures_become_messages():
    figures = Figures()
    given = {
        "cameras": {"one": CameraCount(9, 1, 0, False)},
        "partial": 1,
        "dropped": 3,
        "waiting": 1,
        "tracks": 1,
        "stages_ms": {"track": 0.5},
        "failed_sends": {"mqtt": 2},
    }
    assert fits(health_message("health", MOMENT, figures.health(**given)))["latency_ms"] is None
    for latency in (0.1, 0.2, 0.3):
        figures.frame(latency)
    figures.sighting("drone")
    figures.unusable("nothing-there")
    told = fits(health_message("stopped", MOMENT, figures.health(**given)))
    assert told["latency_ms"]["p50"] == pytest.approx(200) and told["latency_ms"]["max"] == pytest.approx(300)
    assert told["frames"] == 3 and told["sightings"] == {"drone": 1} and told["unusable"] == {"nothing-there": 1}
    assert told["cameras"]["one"] == {"given": 9, "late": 1, "surplus": 0, "silent": False}
    assert told["resources"]["resident_mb"] > 10 and told["failed_sends"] == {"mqtt": 2}


def test_the_schema_is_one_and_refuses_what_is_no_message():
    schema = pytest.importorskip("jsonschema", reason="jsonschema comes with requirements.clients.lock")
    schema.Draft202012Validator.check_schema(message_schema())
    assert SCHEMA.name == "message.schema.json"
    for wrong in (message("track", MOMENT), {**message("dropped", MOMENT, frames=1, total=1), "version": 2}):
        with pytest.raises(schema.ValidationError):
            fits(wrong)
