"""The whole service: what it says is what is found offline; it survives kills, lost cameras, full disks and Ctrl-C."""

from __future__ import annotations

import functools
import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest
from support.live_sites import FPS, write_frames, write_site
from support.networks import network, position_at

from aerojax.capture.format import read_capture
from aerojax.classify.base import untrained
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.events import Updated
from aerojax.pipeline.source import capture_frames
from aerojax.pipeline.step import make_pipeline
from aerojax.pipeline.stream import stream
from aerojax.reconstruct.hull import HullConfig
from aerojax.segment.instances import InstancesConfig
from aerojax.serve.intake import IntakeConfig
from aerojax.serve.messages import message_schema
from aerojax.serve.service import Service, ServiceConfig
from aerojax.serve.sinks.json_lines import JsonLines
from aerojax.serve.sources.folder import FolderConfig
from aerojax.serve.sources.playback import PlaybackConfig
from aerojax.track.several import SeveralConfig

CAMERAS = network(4)
SMALL = PipelineConfig(
    segment=InstancesConfig(),
    track=SeveralConfig(),
    reconstruct=HullConfig(grid=32, capacity=512),
    crop_size=64,
    decimation=DecimationConfig(512, 96, 64),
    lost_after=3,
)
NETWORK = MambaSplatConfig(d_model=32, depth=1, mamba_layers=2, scale_normalisation="running")
QUICK = FolderConfig(poll_s=0.002, settle_s=0.05)
PATIENT = ServiceConfig(intake=IntakeConfig(wait_s=5.0))


@functools.cache
def classifier():
    return untrained(NETWORK, tokens=32, frames=8, key=jax.random.key(1))


class Kept:
    """A sink that keeps everything; it fails where it is told to."""

    name, vital = "kept", False

    def __init__(self, failing: bool = False) -> None:
        self.messages: list[dict] = []
        self.closed, self._failing = False, failing

    def send(self, message, sighting) -> None:
        if self._failing:
            raise OSError(28, "No space left on device")
        self.messages.append(message)

    def see(self, health) -> None:
        pass

    def close(self) -> None:
        self.closed = True

    def of(self, kind: str) -> list[dict]:
        return [one for one in self.messages if one["type"] == kind]


def pipeline(cameras=CAMERAS):
    return make_pipeline(cameras, SMALL, classifier(), key=jax.random.key(0))


def served(source, state: Path, config: ServiceConfig = PATIENT, sinks: Sequence = (), stop=None) -> Kept:
    kept = Kept()
    service = Service(source, pipeline(source.site.cameras), [kept, *sinks], config, state=state, version="test")
    service.run(stop or threading.Event())
    assert kept.closed
    return kept


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    place = write_site(tmp_path_factory.mktemp("recorded") / "site", CAMERAS, frames=8)
    write_frames(place, CAMERAS, range(8))
    return place


@pytest.fixture(scope="module")
def offline(folder) -> list[Updated]:
    """What the fold over the finished capture finds."""
    capture = read_capture(folder)
    events = [e for es, _ in stream(pipeline(), capture_frames(capture)) for e in es]
    return [event for event in events if isinstance(event, Updated)]


def agrees(tracks: list[dict], offline: list[Updated]) -> None:
    assert [(one["frame"], one["track"]) for one in tracks] == [(one.frame, one.track) for one in offline]
    for ours, theirs in zip(tracks, offline, strict=True):
        np.testing.assert_array_equal(ours["position"], theirs.position)
        told = [ours["probabilities"][name] for name in CLASSES]
        np.testing.assert_allclose(told, np.exp(np.asarray(theirs.log_probabilities, np.float64)), rtol=1e-12)
        assert ours["time_s"] == pytest.approx(theirs.frame / FPS)


def test_played_or_growing_it_says_what_is_found_offline(folder, offline, tmp_path):
    schema = pytest.importorskip("jsonschema", reason="jsonschema comes with requirements.clients.lock")
    played = served(PlaybackConfig(rate=0.0).build(folder), tmp_path / "played")
    assert len(offline) >= 5
    agrees(played.of("track"), offline)
    config = replace(PATIENT, frames=8)
    growing = write_site(tmp_path / "site", CAMERAS)
    writer = threading.Thread(
        target=lambda: [(write_frames(growing, CAMERAS, range(n, n + 1)), time.sleep(0.02)) for n in range(8)]
    )
    writer.start()
    grown = served(QUICK.build(growing), tmp_path / "grown", config)
    writer.join()
    agrees(grown.of("track"), offline)
    first, last = grown.messages[0], grown.messages[-1]
    assert first["type"] == "started" and first["resumed"] is None and len(first["cameras"]) == 4
    assert last["type"] == "stopped" and last["frames"] == 8 and last["dropped"] == 0
    assert set(last["stages_ms"]) >= {"read", "segment", "track", "crop", "classify"} and last["latency_ms"]["p95"] > 0
    assert [one["type"] for one in grown.messages if one["type"] != "track"][1] == "appeared"
    for one in grown.messages:
        schema.validate(json.loads(json.dumps(one)), message_schema())
    seen = grown.of("track")[-1]
    assert np.linalg.norm(np.subtract(seen["position"], position_at(seen["frame"]))) < 0.05
    step = np.subtract(position_at(seen["frame"]), position_at(seen["frame"] - 2)) * FPS / 2
    assert np.linalg.norm(np.subtract(seen["velocity"], step)) < 0.5 * np.linalg.norm(step)
    assert seen["cameras"] == [camera.name for camera in CAMERAS] and seen["status"] in ("ok", "unsure", "insufficient")


def test_another_service_goes_on_with_tracks_and_answers(folder, offline, tmp_path):
    source = PlaybackConfig(rate=0.0, look_ahead=False).build(folder)
    first = served(source, tmp_path / "state", replace(PATIENT, frames=5))
    second = served(source, tmp_path / "state")
    assert second.messages[0]["resumed"] == 4 and second.messages[0]["began"] == first.messages[0]["began"]
    assert second.of("appeared") == []
    agrees([*first.of("track"), *second.of("track")], offline)
    with pytest.raises(UserError, match="was made with other settings"):
        served(replace(source, site=replace(source.site, fps=10.0)), tmp_path / "state")


def test_a_camera_that_falls_silent_is_named_and_done_without(folder, offline, tmp_path):
    site = write_site(tmp_path / "site", CAMERAS)
    write_frames(site, CAMERAS, range(8))
    for number in range(2, 8):
        (site / f"cam_04/{number:06d}.png").unlink()
    config = ServiceConfig(intake=IntakeConfig(wait_s=5.0, silent_s=1.0), frames=8)
    told = served(QUICK.build(site), tmp_path / "state", config)
    used = [one["cameras"] for one in told.of("track")]
    assert [one["frame"] for one in told.of("track")] == [one.frame for one in offline]
    assert used[-1] == ["cam_01", "cam_02", "cam_03"] and {one["track"] for one in told.of("track")} == {0}


def test_one_sink_that_fails_costs_the_others_nothing(folder, tmp_path):
    kept = served(PlaybackConfig(rate=0.0).build(folder), tmp_path / "state", sinks=[Kept(failing=True)])
    assert kept.of("track") and kept.messages[-1]["failed_sends"] == {"kept": len(kept.messages) - 1}


def test_idle_or_told_it_ends(folder, tmp_path):
    source = QUICK.build(folder)
    config = ServiceConfig(intake=IntakeConfig(silent_s=0.1, wait_s=5.0), idle_s=0.3)
    told = served(source, tmp_path / "idle", config)
    states = [one["state"] for one in told.of("camera")]
    assert states.count("silent") - states.count("back") == 4 and told.of("lacking")
    assert told.messages[-1]["frames"] == 8
    stop = threading.Event()
    stop.set()
    assert [one["type"] for one in served(source, tmp_path / "stop", stop=stop).messages] == ["started", "stopped"]


def test_a_source_that_breaks_ends_the_service_with_its_state_saved(folder, tmp_path):
    class Broken:
        site, numbered = PlaybackConfig().build(folder).site, True

        def preview(self):
            return None

        def run(self, intake, since, stop):
            raise RuntimeError("a bug")

    with pytest.raises(RuntimeError, match="a bug"):
        served(Broken(), tmp_path / "state")
    assert (tmp_path / "state").is_file()


def test_a_disk_that_takes_no_state_is_told_once(folder, tmp_path):
    (tmp_path / "file").write_text("")
    config = replace(PATIENT, save_s=0.01)
    told = served(PlaybackConfig(rate=0.0).build(folder), tmp_path / "file/state", config)
    assert len(told.of("state")) == 1 and "would go on from an older state" in told.of("state")[0]["text"]


# Kills of the act itself

ACT = [
    *("pipeline.crop_size=64", "pipeline.reconstruct.grid=32", "pipeline.reconstruct.capacity=512"),
    *("pipeline.decimation.draw=512", "pipeline.decimation.farthest=96", "pipeline.decimation.keep=64"),
    *("segment=instances", "sources=folder", "source.poll_s=0.002", "service.intake.wait_s=2", "service.save_s=0.05"),
]


def lines_of(path: Path) -> list[dict]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def wait_for(what, seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "nothing came"
        time.sleep(0.05)


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_killed_act_goes_on_with_its_tracks(tmp_path, number):
    from aerojax.classify.load import save_classifier

    save_classifier(tmp_path / "weights.safetensors", classifier())
    site, out = write_site(tmp_path / "site", CAMERAS), tmp_path / "out.jsonl"
    write_frames(site, CAMERAS, range(6))
    where = [f"capture={site}", f"output={out}", f"state={tmp_path}/state", f"weights={tmp_path}/weights.safetensors"]
    command = [sys.executable, "-m", "experiments.serve", *where, *ACT, f"hydra.run.dir={tmp_path}/run"]
    root = Path(__file__).resolve().parents[2]

    def tracks() -> list[dict]:
        return [one for one in lines_of(out) if one["type"] == "track"]

    with subprocess.Popen(command, cwd=root, stderr=subprocess.PIPE) as process:
        wait_for(lambda: process.poll() is not None or (tracks() and tracks()[-1]["frame"] == 5))
        time.sleep(0.5)
        process.send_signal(number)
        assert process.stderr is not None
        told, code = process.stderr.read().decode(), process.wait()
    assert code == (-signal.SIGKILL if number == signal.SIGKILL else 0), told
    assert "Traceback" not in told
    first = tracks()
    write_frames(site, CAMERAS, range(6, 12))
    subprocess.run([*command, "service.idle_s=1"], cwd=root, check=True, capture_output=True)
    second = tracks()[len(first) :]
    assert {one["track"] for one in (*first, *second)} == {0} and second[-1]["frame"] == 11
    resumed = [one["resumed"] for one in lines_of(out) if one["type"] == "started"]
    assert resumed[0] is None and resumed[1] is not None and second[0]["frame"] == resumed[1] + 1 >= 5
    again = {one["frame"]: one for one in first}
    for one in second:
        if one["frame"] in again:
            assert one["probabilities"] == again[one["frame"]]["probabilities"]
    assert json.loads((tmp_path / "run/summary.json").read_text())["type"] == "stopped"


def test_lines_are_written_as_they_come(folder, tmp_path):
    served(PlaybackConfig(rate=0.0).build(folder), tmp_path / "state", sinks=[JsonLines(tmp_path / "out.jsonl")])
    kinds = [one["type"] for one in lines_of(tmp_path / "out.jsonl")]
    assert kinds[0] == "started" and kinds[-1] == "stopped" and kinds.count("track") >= 5
