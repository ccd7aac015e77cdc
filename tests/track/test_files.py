"""Files of detections, cameras and tracks: every layout is read, and what is wrong is named with its line."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from support.flights import path, ring, watch

from aerojax.core.errors import UserError
from aerojax.track.camera_files import CameraFile, read_cameras, write_cameras
from aerojax.track.detection_files import read_detections, write_detections
from aerojax.track.following import FollowingConfig
from aerojax.track.offline import follow
from aerojax.track.track_files import COLUMNS, write_tracks

CAMERAS = ring(4)
KNOWN = CameraFile(CAMERAS, {"cam_00": 25.0})


def read(tmp_path, text: str, name: str = "found.jsonl"):
    (tmp_path / name).write_text(text)
    return read_detections([tmp_path / name], KNOWN)


def test_points_boxes_and_frames(tmp_path):
    text = """
{"camera": "cam_01", "time_s": 0.5, "x": 10.5, "y": 20, "score": 0.3}
{"camera": "cam_02", "time_s": 1, "box": [10, 20, 13, 24]}
{"camera": "cam_00", "frame": 50, "x": 1, "y": 2}
"""
    found = read(tmp_path, text)
    assert found.camera.tolist() == [1, 2, 0] and found.stamp_s.tolist() == [0.5, 1.0, 2.0]
    assert found.pixels.tolist() == [[10.5, 20], [11.5, 22], [1, 2]] and found.diagonal.tolist() == [0, 5, 0]


def test_tables_say_the_same(tmp_path):
    found = read(
        tmp_path, "camera, time_s, x0, y0, x1, y1, x, y\ncam_01,0.5,10,20,13,24,,\ncam_02,1,,,,,7,8\n", "a.csv"
    )
    assert found.pixels.tolist() == [[11.5, 22], [7, 8]] and found.diagonal.tolist() == [5, 0]
    alone = read(tmp_path, "time_s,x,y\n0.5,10,20\n", "cam_03.csv")
    assert alone.camera.tolist() == [3]
    assert len(read_detections([tmp_path], KNOWN).camera) == 3


def test_what_is_written_is_read(tmp_path):
    seen = watch([path(np.random.default_rng(0))], CAMERAS, seconds=0.2, rng=np.random.default_rng(0)).detections
    write_detections(tmp_path / "a.jsonl", seen, CAMERAS)
    again = read_detections([tmp_path / "a.jsonl"], KNOWN)
    assert again.pixels.tolist() == seen.pixels.tolist() and again.stamp_s.tolist() == seen.stamp_s.tolist()


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('{"camera": "cam_09", "time_s": 0, "x": 1, "y": 2}', "line 1: camera 'cam_09' is unknown; cameras are cam_00"),
        ('{"time_s": 0, "x": 1, "y": 2}', "line 1: has no camera"),
        ('{"camera": "cam_01", "x": 1, "y": 2}', "has neither time_s nor frame"),
        ('{"camera": "cam_01", "frame": 3, "x": 1, "y": 2}', "the fps of cam_01 is not known"),
        ('{"camera": "cam_01", "time_s": "x", "x": 1, "y": 2}', "time_s must be a finite number"),
        ('{"camera": "cam_01", "time_s": NaN, "x": 1, "y": 2}', "time_s must be a finite number"),
        ('{"camera": "cam_01", "time_s": 0, "u": 1, "v": 2}', "has neither x and y nor a box"),
        ('{"camera": "cam_01", "time_s": 0, "box": [1, 2, 3]}', "write x0, y0, x1, y1"),
        ('{"camera": "cam_01", "time_s": 0, "box": [1, 2, 1, 3]}', "is empty"),
        ("[1, 2]", "line 1 is no JSON object"),
        ("{", "line 1 is not valid JSON"),
        ("", "no detection"),
    ],
)
def test_a_wrong_line_is_named(tmp_path, line, told):
    with pytest.raises(UserError) as caught:
        read(tmp_path, line)
    assert told in str(caught.value) and "\n" not in str(caught.value)


def test_files_that_are_none(tmp_path):
    (tmp_path / "found.txt").write_text("x")
    (tmp_path / "found.csv").write_bytes(b"camera,time_s,x,y\n\xff\xfe")
    for name, told in (("found.txt", "is no .jsonl"), ("found.csv", "utf-8"), ("none.csv", "cannot be read")):
        with pytest.raises(UserError, match=told):
            read_detections([tmp_path / name], KNOWN)
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError, match="in this folder"):
        read_detections([tmp_path / "empty"], KNOWN)


def test_cameras_with_clocks_of_their_own(tmp_path):
    cameras = tuple(replace(c, clock_rate=1.001, line_delay_s=2e-5, time_offset_s=-0.1) for c in CAMERAS)
    write_cameras(tmp_path / "cameras.json", cameras)
    known = read_cameras(tmp_path / "cameras.json")
    for one, other in zip(known.cameras, cameras, strict=True):
        assert (one.name, one.time_offset_s, one.clock_rate, one.line_delay_s) == (
            "cam_0" + one.name[-1],
            -0.1,
            1.001,
            2e-5,
        )
        np.testing.assert_allclose(one.world_from_cam, other.world_from_cam, atol=1e-12)
    raw = json.loads((tmp_path / "cameras.json").read_text()) | {"fps": 30, "format": "aerojax-capture", "frames": 3}
    (tmp_path / "capture.json").write_text(json.dumps(raw))
    assert read_cameras(tmp_path).fps == {camera.name: 30.0 for camera in CAMERAS}


def test_wrong_cameras_are_named_all_at_once(tmp_path):
    write_cameras(tmp_path / "cameras.json", CAMERAS)
    raw = json.loads((tmp_path / "cameras.json").read_text())
    raw["cameras"][0] |= {"clock_rate": 30.0, "line_delay_s": 0.02, "fps": 0}
    raw["cameras"][1] |= {"K": 3, "colour": "red"}
    (tmp_path / "cameras.json").write_text(json.dumps(raw))
    with pytest.raises(UserError) as caught:
        read_cameras(tmp_path / "cameras.json")
    for word in ("cameras[0].clock_rate", "cameras[0].line_delay_s", "cameras[0].fps", "cameras[1].K", "colour"):
        assert word in str(caught.value)
    (tmp_path / "cameras.json").write_text("[]")
    with pytest.raises(UserError, match="has no list `cameras`"):
        read_cameras(tmp_path / "cameras.json")


def test_tracks_are_written_in_both_ways(tmp_path):
    seen = watch([path(np.random.default_rng(0))], CAMERAS, seconds=0.3, rng=np.random.default_rng(0), clutter=0)
    done = follow(seen.detections, CAMERAS, FollowingConfig())
    write_tracks(tmp_path / "tracks.jsonl", done, CAMERAS)
    write_tracks(tmp_path / "tracks.csv", done, CAMERAS)
    lines = [json.loads(line) for line in (tmp_path / "tracks.jsonl").read_text().splitlines()]
    rows = list(csv.DictReader((tmp_path / "tracks.csv").read_text().splitlines()))
    assert len(lines) == len(rows) == sum(len(m.tracks) for m in done.moments) > 5
    last, row = lines[-1], rows[-1]
    assert last["track"] == 0 and last["status"] == "confirmed" and len(last["covariance"]) == 6
    assert set(row) == set(COLUMNS) and float(row["yz_m2"]) == last["covariance"][1][2]
    assert [float(row[name]) for name in ("vx_m_s", "vy_m_s", "vz_m_s")] == last["velocity"]
