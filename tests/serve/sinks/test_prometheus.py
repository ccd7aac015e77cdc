"""Prometheus' own parser reads the metrics."""

from __future__ import annotations

import pytest

from aerojax.serve.figures import Figures
from aerojax.serve.intake import CameraCount
from aerojax.serve.sinks.prometheus import exposition

NAME = 'north "gate"\\\nx'


def test_the_parser_of_prometheus_reads_every_value():
    parser = pytest.importorskip("prometheus_client.parser")
    figures = Figures()
    for latency in (0.1, 0.2, 0.3):
        figures.frame(latency)
    figures.sighting("drone")
    health = figures.health(
        cameras={NAME: CameraCount(9, 1, 2, True)},
        partial=1,
        dropped=3,
        waiting=1,
        tracks=2,
        stages_ms={"track": 500.0},
        failed_sends={"mqtt": 2},
    )
    families = {one.name: one for one in parser.text_string_to_metric_families(exposition(health))}
    assert families["aerojax_frames"].type == "counter" and families["aerojax_frame_to_track_seconds"].type == "summary"
    samples = {(s.name, tuple(s.labels.values())): s.value for one in families.values() for s in one.samples}
    assert samples["aerojax_frame_to_track_seconds", ("0.5",)] == pytest.approx(0.2)
    assert samples["aerojax_frame_to_track_seconds_sum", ()] == pytest.approx(0.6)
    wanted = {
        ("aerojax_frames_total", ()): 3,
        ("aerojax_frames_partial_total", ()): 1,
        ("aerojax_frames_dropped_total", ()): 3,
        ("aerojax_pictures_total", (NAME,)): 9,
        ("aerojax_pictures_late_total", (NAME,)): 1,
        ("aerojax_pictures_surplus_total", (NAME,)): 2,
        ("aerojax_camera_silent", (NAME,)): 1,
        ("aerojax_sightings_total", ("drone",)): 1,
        ("aerojax_stage_seconds", ("track",)): 0.5,
        ("aerojax_send_failures_total", ("mqtt",)): 2,
        ("aerojax_tracks", ()): 2,
    }
    assert {key: samples[key] for key in wanted} == wanted
    assert all(one.documentation for one in families.values())


def test_before_the_first_frame_there_is_no_latency():
    parser = pytest.importorskip("prometheus_client.parser")
    text = exposition(
        Figures().health(cameras={}, partial=0, dropped=0, waiting=0, tracks=0, stages_ms={}, failed_sends={})
    )
    names = {s.name for one in parser.text_string_to_metric_families(text) for s in one.samples}
    assert "aerojax_frame_to_track_seconds_count" in names and "aerojax_frame_to_track_seconds" not in names
