"""The act `track` from files and from a capture's masks, with and without corrections, and again after a restart."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from support.command_line import run_command
from support.flights import path, ring, watch

from aerojax.capture.format import Capture, CaptureCamera, ObjectState, TrackedObject, Truth, write_capture_json
from aerojax.geometry.cameras import look_at, project_points
from aerojax.track.adjust.corrections import Correction, corrected
from aerojax.track.camera_files import read_cameras, write_cameras
from aerojax.track.detection_files import write_detections
from experiments import track

CAMERAS = ring(4)


@pytest.fixture
def act(monkeypatch, tmp_path):
    def run(name: str, *arguments: str):
        run_command(track, monkeypatch, f"hydra.run.dir={tmp_path / name}", *arguments)
        return tmp_path / name

    return run


def test_detections_become_tracks_and_go_on_after_a_restart(act, tmp_path):
    rng = np.random.default_rng(0)
    seen = watch([path(rng), path(rng)], CAMERAS, seconds=1.0, rng=rng).detections
    write_cameras(tmp_path / "cameras.json", CAMERAS)
    early = seen.stamp_s < 0.5
    for name, rows in (("one", early), ("two", ~early)):
        write_detections(tmp_path / f"{name}.jsonl", seen.chosen(rows), CAMERAS)
    first = act("first", f"source={tmp_path}/one.jsonl", f"cameras={tmp_path}/cameras.json")
    where = (f"source={tmp_path}/two.jsonl", f"cameras={tmp_path}/cameras.json", f"state={first}/state.json")
    lines = [json.loads(line) for line in (act("second", *where) / "tracks.jsonl").read_text().splitlines()]
    assert {line["track"] for line in lines} == {0, 1} and lines[0]["status"] == "confirmed"
    assert lines[0]["time_s"] == pytest.approx(0.5) and len(lines) == 30
    metrics = json.loads((first / "metrics.json").read_text())
    assert metrics["tracks"] == 2 and metrics["moments"] == 15


@pytest.mark.long
def test_corrections_are_reported_and_applied_on_request_alone(act, tmp_path):
    rng = np.random.default_rng(0)
    turn = Correction(0.0, 0.0, 0.0, np.radians([0.3, -0.3, 0.25]), np.zeros(3), np.zeros(9))
    given = (*CAMERAS[:2], corrected(CAMERAS[2], turn), CAMERAS[3])
    write_cameras(tmp_path / "cameras.json", given)
    write_detections(tmp_path / "a.jsonl", watch([path(rng)], CAMERAS, seconds=3.0, rng=rng).detections, CAMERAS)
    asked = (f"source={tmp_path}/a.jsonl", f"cameras={tmp_path}/cameras.json", "adjust.clocks=false")
    used = {}
    for name in ("find", "apply"):
        run = act(name, *asked, "adjust.line_delay=false", f"{name}_corrections=true")
        told = json.loads((run / "corrections.json").read_text())
        assert told["applied"] == (name == "apply") and told["cameras"][2]["before_px"] > 5
        found = read_cameras(run / "cameras.json").cameras
        assert abs(found[2].world_from_cam - CAMERAS[2].world_from_cam)[:3, :3].max() < 2e-3
        lines = [json.loads(line) for line in (run / "tracks.jsonl").read_text().splitlines()]
        used[name] = np.mean([len(line["cameras"]) for line in lines])
    assert used["apply"] > 3.3 > 3.1 > used["find"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("source={0}/a.jsonl",), "cameras is not set"),
        (("source={0}/a.jsonl", "cameras={0}/none.json"), "cannot be read"),
        (("source={0}/a.jsonl", "cameras={0}/cameras.json"), "line 1: has neither x and y nor a box"),
    ],
)
def test_mistakes_end_in_one_line(act, tmp_path, capsys, arguments, told):
    write_cameras(tmp_path / "cameras.json", CAMERAS)
    (tmp_path / "a.jsonl").write_text('{"camera": "cam_00", "time_s": 0, "u": 1, "v": 1}\n')
    with pytest.raises(SystemExit) as caught:
        act("run", *(one.format(tmp_path) for one in arguments))
    said = capsys.readouterr().err
    assert caught.value.code == 2 and told in said and "Traceback" not in said


def masked_capture(folder, frames: int = 12) -> Capture:
    """Two discs that fly past each other, in three cameras' masks; their ids differ from camera to camera."""
    K = np.array([[200.0, 0, 80], [0, 200.0, 60], [0, 0, 1]])
    centres = ((9.0, 0, 1), (-4.0, 8, 2), (-5.0, -7, 1))
    cameras = tuple(
        CaptureCamera(
            f"cam_{i}",
            160,
            120,
            K,
            "none",
            (),
            look_at(np.array(at), np.array([0, 0, 4.0])),
            f"cam_{i}/{{frame}}.png",
            f"cam_{i}/m{{frame}}.png",
            None,
            0.0,
        )
        for i, at in enumerate(centres)
    )
    times = np.arange(frames) / 30
    places = np.stack(
        [
            np.stack([-1 + 4 * times, 0 * times, 4 + 0 * times], 1),
            np.stack([1 - 4 * times, 0.6 + 0 * times, 4.5 + times], 1),
        ]
    )
    for index, camera in enumerate(cameras):
        (folder / camera.name).mkdir(parents=True)
        for frame in range(frames):
            mask = np.zeros((120, 160), np.uint16)
            for number in range(2):
                u, v = project_points(places[number, frame], camera)
                cv2.circle(mask, (int(u), int(v)), 3, 1 + (number + index) % 2, -1)
            cv2.imwrite(str(folder / camera.name / f"m{frame}.png"), mask)
            cv2.imwrite(str(folder / camera.name / f"{frame}.png"), np.zeros((120, 160, 3), np.uint8))
    objects = tuple(
        TrackedObject(
            n + 1,
            "drone",
            f"disc_{n}",
            tuple(ObjectState(f, tuple(places[n, f].tolist()), (1.0, 0.0, 0.0, 0.0), {}, {}) for f in range(frames)),
        )
        for n in range(2)
    )
    capture = Capture(folder, 30.0, frames, cameras, Truth(objects), mask_kind="ids")
    write_capture_json(capture)
    return capture


def test_masks_of_a_capture_become_tracks(act, tmp_path):
    masked_capture(tmp_path / "capture")
    run = act("run", f"source={tmp_path}/capture")
    figures = json.loads((run / "metrics.json").read_text())["figures"]
    assert figures["idf1"] == 1.0 and figures["ghosts"] == 0 and figures["rmse"] < 0.1
