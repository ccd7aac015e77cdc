"""The page: whom it answers, that it holds nothing of the site but text, and what it draws."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from datetime import UTC, datetime

import pytest
from support.chromium import chromium, needs_chromium

from aerojax.core.errors import UserError
from aerojax.serve.figures import Figures
from aerojax.serve.intake import CameraCount
from aerojax.serve.messages import message
from aerojax.serve.sinks.web import Web, WebConfig, is_loopback

NOW = datetime(2026, 5, 1, tzinfo=UTC)
EVIL = '<img src=x onerror="window.hit=1">'
TOKEN = "0123456789abcdef"


def ask(address: str, **headers: str) -> tuple[int, str, dict[str, str]]:
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=5) as answer:
            return answer.status, answer.read().decode(), dict(answer.headers)
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode(), dict(error.headers)


def track(number: int, x: float, label: str | None) -> dict:
    told = {"track": number, "frame": 1, "time_s": 0.1, "position": [x, 2.0, 30.0], "velocity": [3.0, 4.0, 0.0]}
    chances = {"bird": 0.1, "drone": 0.7, "airplane": 0.1, "helicopter": 0.1}
    return message("track", NOW, **told, label=label, status="ok", most_likely="drone", probabilities=chances)


def fed(web: Web) -> None:
    camera = {"name": EVIL, "position": [0.0, 0.0, 2.0], "view": [[0.6, 0.8, 0.0], [0.8, 0.6, 0.0]]}
    web.send(message("started", NOW, cameras=[camera], classifier=EVIL, aerojax="1", began="", resumed=None), None)
    for x in (10.0, 11.0, 12.0):
        web.send(track(3, x, "drone"), None)
    web.send(track(4, 5.0, None), None)
    web.send(message("lost", NOW, frame=1, time_s=0.1, track=4), None)
    web.send(message("camera", NOW, camera=EVIL, state="silent", text=EVIL), None)
    given = {"partial": 0, "dropped": 0, "waiting": 0, "tracks": 1, "stages_ms": {}, "failed_sends": {}}
    web.see(Figures().health(cameras={EVIL: CameraCount(3, 0, 0, True)}, **given))


@pytest.fixture
def web():
    made = Web(WebConfig(port=0))
    yield made
    made.close()


def test_the_page_the_state_and_the_metrics(web):
    fed(web)
    status, page, headers = ask(web.address)
    assert status == 200 and EVIL not in page and "http" not in page.replace("http://www.w3.org/2000/svg", "")
    assert "default-src 'none'" in headers["Content-Security-Policy"] and headers["X-Frame-Options"] == "DENY"
    shown = json.loads(ask(f"{web.address}state")[1])
    (only,) = shown["tracks"]
    assert only["track"] == 3 and only["trail"] == [[10.0, 2.0, 30.0], [11.0, 2.0, 30.0], [12.0, 2.0, 30.0]]
    assert [one["type"] for one in shown["events"]] == ["camera", "lost", "started"]
    assert shown["health"]["cameras"][EVIL]["silent"] and shown["started"]["classifier"] == EVIL
    status, metrics, headers = ask(f"{web.address}metrics")
    assert status == 200 and "aerojax_tracks 1.0" in metrics and headers["Content-Type"].startswith("text/plain")
    assert ask(f"{web.address}../etc/passwd")[0] == 404


def test_requests_that_were_sent_to_another_name_are_refused(web):
    assert ask(web.address, Host="attacker.example:80")[0] == 403
    assert ask(web.address, Host="localhost:1")[0] == 200 and ask(web.address, Host="[::1]:1")[0] == 200


def test_with_a_token_every_request_must_bring_it(tmp_path):
    (tmp_path / "token").write_text(f"{TOKEN}\n")
    web = Web(WebConfig(port=0, host="0.0.0.0", token_file=tmp_path / "token"))
    try:
        address = web.address.replace("0.0.0.0", "127.0.0.1")
        for path in ("", "state", "metrics", "none"):
            assert ask(address + path)[0] == ask(f"{address}{path}?token={TOKEN[:-1]}")[0] == 403
            assert ask(address + path, Authorization="Bearer wrong")[0] == 403
        assert ask(f"{address}state?token={TOKEN}")[0] == 200
        assert ask(f"{address}metrics", Authorization=f"Bearer {TOKEN}", Host="site.example")[0] == 200
    finally:
        web.close()


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.0.7", "example.org"])
def test_another_address_needs_a_token(host):
    assert not is_loopback(host)
    with pytest.raises(UserError, match=r"web\.token_file is not set"):
        WebConfig(port=8080, host=host)
    WebConfig(port=None, host=host)  # nothing is served


def test_mistakes_are_named(tmp_path, web):
    (tmp_path / "short").write_text("abc\n")
    for file, told in (("short", "has 3 characters"), ("none", "cannot be read")):
        with pytest.raises(UserError, match=told):
            Web(WebConfig(port=0, token_file=tmp_path / file))
    port = int(web.address.rsplit(":", 1)[1].strip("/"))
    with pytest.raises(UserError, match=f"web.port={port}: .* cannot be listened to") as caught:
        Web(WebConfig(port=port))
    assert caught.value.code == "occupied"
    with pytest.raises(UserError, match=r"web\.port is 70000"):
        WebConfig(port=70_000)


@needs_chromium
@pytest.mark.long
def test_the_page_draws_cameras_tracks_and_events_as_text(web, tmp_path):
    fed(web)
    with chromium(tmp_path / "profile") as tab:
        tab.call("Page.navigate", url=web.address)
        tab.run(
            "new Promise(done => { const look = () => "
            "document.querySelector('.spot') ? done(1) : setTimeout(look, 50); look(); })"
        )
        assert tab.run("window.hit") is None and tab.run("document.images.length") == 0
        drawn = tab.run("[...document.querySelectorAll('#map text')].map(one => one.textContent)")
        assert EVIL in drawn and "3: drone" in drawn
        assert tab.run("document.querySelectorAll('.spot.drone').length") == 1
        assert tab.run("document.querySelectorAll('.camera.bad').length") == 1
        assert tab.run("document.querySelector('#tracks').textContent") == "3drone30.05.0"
        assert EVIL in tab.run("document.querySelector('#events').textContent")
        wrong = [one for one in tab.complaints() if not one.startswith(f"request: {web.address}")]
        assert wrong == []
