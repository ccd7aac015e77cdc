"""Detection reports that the standard's own bindings read, with ids that last."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from support.networks import network

from aerojax.capture.format import Capture
from aerojax.core.errors import UserError
from aerojax.geometry.geodesy import GeographicOrigin
from aerojax.pipeline.track_points import TrackPoint
from aerojax.serve.messages import Sighting, message
from aerojax.serve.sinks.sapient import Sapient

NOW = datetime(2026, 5, 1, 12, tzinfo=UTC)
CHANCES = {"bird": 0.1, "drone": 0.7, "airplane": 0.1, "helicopter": 0.1}


def site(tmp_path: Path, *, origin: bool = True) -> Capture:
    place = GeographicOrigin(52.0, 13.0, 40.0) if origin else None
    return Capture(tmp_path, 30.0, 1, network(3), None, origin=place)


def sighting(track: int, frame: int) -> Sighting:
    where = {"position": (1.0, 2.0, 3.0), "velocity": (3.0, 0.0, -1.0), "size": (0.5, 0.4, 0.1)}
    point = TrackPoint(frame, frame / 30, **where, probabilities=CHANCES, place=(52.1, 13.2, 43.0))
    moment = NOW + timedelta(seconds=frame)
    return Sighting(message("track", moment, track=track), point, track, moment)


def test_reports_are_read_by_the_bindings_and_ids_last_over_a_restart(tmp_path):
    pytest.importorskip("sapient_msg", reason="sapient-msg comes with requirements.clients.lock")
    from google.protobuf import json_format
    from sapient_msg.bsi_flex_335_v2_0 import sapient_message_pb2

    began = {"began": "2026-05-01T11:00:00+00:00"}
    for frames in ((1, 2), (3,)):
        sink = Sapient(tmp_path / "out.jsonl", site(tmp_path))
        sink.send(message("started", NOW, **began), None)
        for frame in frames:
            for track in (0, 5):
                one = sighting(track, frame)
                sink.send(one.message, one)
        sink.close()
    lines = (tmp_path / "out.jsonl").read_text().splitlines()
    found = [json_format.Parse(line, sapient_message_pb2.SapientMessage()) for line in lines]
    assert len(found) == 6 and len({one.node_id for one in found}) == 1
    reports = [one.detection_report for one in found]
    assert len({one.object_id for one in reports}) == 2 and len({one.report_id for one in reports}) == 6
    assert reports[0].object_id == reports[4].object_id and all(len(one.object_id) == 26 for one in reports)
    assert (reports[0].location.x, reports[0].location.y, reports[0].location.z) == (13.2, 52.1, 43.0)
    assert reports[0].enu_velocity.east_rate == 3.0
    air = next(one for one in reports[0].classification if one.type == "Air vehicle")
    assert air.confidence == pytest.approx(0.9)
    assert found[0].timestamp.ToDatetime(UTC) == NOW + timedelta(seconds=1)


def test_cameras_without_a_place_on_the_earth_are_refused(tmp_path):
    pytest.importorskip("sapient_msg", reason="sapient-msg comes with requirements.clients.lock")
    with pytest.raises(UserError, match="has no origin"):
        Sapient(tmp_path / "out.jsonl", site(tmp_path, origin=False))
