"""RTSP cameras on loopback: pictures, their senders' clocks, reconnections; and what is refused."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
from support.live_sites import write_site
from support.networks import HEIGHT, WIDTH, network
from support.rtsp_server import Camera

from aerojax.core.errors import UserError
from aerojax.serve.intake import Intake, IntakeConfig
from aerojax.serve.notices import SourceFailed
from aerojax.serve.retries import RetryConfig
from aerojax.serve.sources.streams import StreamsConfig, redacted

CLOCK_S = -500.0


def grey(number: int) -> np.ndarray:
    return np.full((HEIGHT, WIDTH, 3), 40 + 10 * (number % 20), np.uint8)


@pytest.fixture
def site(tmp_path):
    return write_site(tmp_path / "site", [replace(one, mask=None) for one in network(3)])


def collected(site, config, count: int) -> tuple[list, Intake]:
    source = config.build(site)
    untriggered = IntakeConfig(wait_s=5.0, tolerance_s=0.049, silent_s=60.0, buffer=100)
    intake, stop = Intake(3, 20.0, untriggered), threading.Event()
    thread = threading.Thread(target=source.run, args=(intake, {}, stop))
    thread.start()
    found, end = [], time.monotonic() + 120
    while len(found) < count and time.monotonic() < end:
        taken = intake.take(0.1)
        found += [] if taken is None or None in taken.pictures else [taken.pictures]
    stop.set()
    thread.join()
    return found, intake


def test_pictures_come_with_their_senders_clock_and_a_camera_that_ends_is_asked_again(site):
    pytest.importorskip("av", reason="av comes with the extra `video`")
    # FFmpeg spends the first second of a stream on finding out what it is.
    cameras = [Camera(grey, 20.0, clock_s=CLOCK_S, most=45 if index == 1 else None) for index in range(3)]
    try:
        config = StreamsConfig(urls=tuple(one.url for one in cameras), retry=RetryConfig(0.05, 0.1))
        found, intake = collected(site, config, 30)
    finally:
        for one in cameras:
            one.close()
    assert len(found) == 30
    assert all(abs(one.time_s - (time.time() + CLOCK_S)) < 30 for one in found[-1])
    image, ids, _ = found[-1][0].load()
    assert image.shape == (HEIGHT, WIDTH, 3) and ids is None and 0.1 < image.mean() < 0.95 and image.std() < 0.02
    assert cameras[1].asked.count("PLAY") > 1
    failed = [one for one in intake.notices() if isinstance(one, SourceFailed)]
    assert failed and {one.camera for one in failed} == {1} and "secret" not in failed[0].text


def test_by_arrival_times_are_this_machines(site):
    pytest.importorskip("av", reason="av comes with the extra `video`")
    cameras = [Camera(grey, 20.0, clock_s=CLOCK_S) for _ in range(3)]
    try:
        found, _ = collected(site, StreamsConfig(urls=tuple(one.url for one in cameras), clock="arrival"), 5)
    finally:
        for one in cameras:
            one.close()
    assert len(found) == 5 and all(abs(one.time_s - time.time()) < 30 for one in found[-1])
    steps = np.diff([frame[0].time_s for frame in found])
    np.testing.assert_allclose(steps, 0.05, atol=0.02)


def test_a_camera_of_another_size_is_left_out(site):
    pytest.importorskip("av", reason="av comes with the extra `video`")
    cameras = [Camera(lambda number: np.zeros((64, 64, 3), np.uint8), 20.0) for _ in range(3)]
    try:
        found, _ = collected(site, StreamsConfig(urls=tuple(one.url for one in cameras)), 1)
        with pytest.raises(UserError, match="64×64 pixels"):
            found[0][0].load()
    finally:
        for one in cameras:
            one.close()


def test_an_address_where_nothing_is_is_tried_again(site):
    pytest.importorskip("av", reason="av comes with the extra `video`")

    class Nothing(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_error(404)

        def log_message(self, format, *args):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Nothing) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = f"http://127.0.0.1:{server.server_address[1]}/none"
        intake, stop = Intake(3, 20.0, IntakeConfig()), threading.Event()
        source = StreamsConfig(urls=(url,) * 3, retry=RetryConfig(0.05, 0.05)).build(site)
        thread = threading.Thread(target=source.run, args=(intake, {}, stop))
        thread.start()
        failed, end = [], time.monotonic() + 60
        while len(failed) < 6 and time.monotonic() < end:
            failed += intake.notices()
            time.sleep(0.01)
        stop.set()
        thread.join()
        server.shutdown()
    assert {one.camera for one in failed} == {0, 1, 2} and all(url in one.text for one in failed)
    assert "404" in failed[0].text or "Not Found" in failed[0].text


@pytest.mark.parametrize(
    ("urls", "named"),
    [
        (("rtsp://a",), "has 1 addresses"),
        (("rtsp://a", "rtsp://b", "file:///etc/passwd"), "file:///etc/passwd is of no kind"),
        (("rtsp://a", "rtsp://b", "concat:a|b"), "is of no kind"),
        (("rtsp://a", "rtsp://b", "/etc/passwd"), "is of no kind"),
    ],
)
def test_what_is_no_camera_is_refused(site, urls, named):
    pytest.importorskip("av", reason="av comes with the extra `video`")
    with pytest.raises(UserError, match=named):
        StreamsConfig(urls=urls).build(site)


def test_without_the_package_the_remedy_is_named(site, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(UserError, match="needs the package av; pip install") as caught:
        StreamsConfig(urls=("rtsp://a",) * 3).build(site)
    assert caught.value.code == "unavailable"


def test_names_passwords_and_keys_are_left_out():
    assert redacted("rtsp://user:pass@10.0.0.1:554/live?key=1") == "rtsp://10.0.0.1:554/live"
