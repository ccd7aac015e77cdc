"""A real broker on loopback: messages arrive under their topics, watchers hear of an end, a broker may come late."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime

import pytest

from aerojax.core.errors import UserError
from aerojax.serve.messages import message
from aerojax.serve.retries import RetryConfig
from aerojax.serve.sinks import mqtt as module
from aerojax.serve.sinks.mqtt import Mqtt, MqttConfig

NOW = datetime(2026, 5, 1, tzinfo=UTC)


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Broker:
    """amqtt's broker and a subscriber to everything, in a thread of their own."""

    def __init__(self, port: int) -> None:
        self.heard: list[tuple[str, str]] = []
        self._port, self._end = port, threading.Event()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()))
        self._thread.start()
        assert self._ready.wait(20)

    async def _run(self) -> None:
        import aiomqtt
        from amqtt.broker import Broker as Server

        listeners = {"default": {"type": "tcp", "bind": f"127.0.0.1:{self._port}"}}
        server = Server({"listeners": listeners, "plugins": {"support.open_broker.Open": {}}})
        await server.start()
        async with aiomqtt.Client("127.0.0.1", self._port) as client:
            await client.subscribe("#", qos=1)
            self._ready.set()
            listening = asyncio.create_task(self._listen(client))
            await asyncio.to_thread(self._end.wait)
            listening.cancel()
        await server.shutdown()

    async def _listen(self, client) -> None:
        async for one in client.messages:
            self.heard.append((str(one.topic), one.payload.decode()))

    def close(self) -> None:
        self._end.set()
        self._thread.join()


def wait_for(what: Callable[[], bool]) -> None:
    end = time.monotonic() + 20
    while not what():
        assert time.monotonic() < end, "nothing came"
        time.sleep(0.02)


@pytest.fixture
def broker():
    pytest.importorskip("amqtt", reason="amqtt comes with requirements.clients.lock")
    pytest.importorskip("aiomqtt", reason="aiomqtt comes with the extra `mqtt`")
    found: list[Broker] = []

    def start(port: int) -> Broker:
        found.append(Broker(port))
        return found[-1]

    yield start
    for one in found:
        one.close()


@pytest.mark.filterwarnings("ignore")
def test_messages_reach_a_broker_that_comes_late_and_the_end_is_heard(broker):
    port = free_port()
    sink = Mqtt(MqttConfig("127.0.0.1", port, prefix="site/north", qos=1, retry=RetryConfig(0.05, 0.1)))
    said = [message("appeared", NOW, frame=1, time_s=0.1, track=4), message("lost", NOW, frame=2, time_s=0.2, track=4)]
    for one in said:
        sink.send(one, None)
    heard = broker(port).heard
    wait_for(lambda: any(topic == "site/north/lost" for topic, _ in heard))
    sink.close()
    wait_for(lambda: ("site/north/status", "offline") in heard)
    told = [(topic, json.loads(text)) for topic, text in heard if topic != "site/north/status"]
    assert told == [("site/north/appeared", said[0]), ("site/north/lost", said[1])]
    assert [text for topic, text in heard if topic == "site/north/status"] == ["online", "offline"]


def test_while_the_broker_is_away_the_oldest_messages_go(monkeypatch):
    pytest.importorskip("aiomqtt", reason="aiomqtt comes with the extra `mqtt`")
    monkeypatch.setattr(module, "_WAITING", 3)
    sink = Mqtt(MqttConfig("127.0.0.1", free_port(), retry=RetryConfig(5.0, 5.0)))
    for number in range(3):
        sink.send(message("lost", NOW, frame=number), None)
    with pytest.raises(OSError, match="in time"):
        sink.send(message("lost", NOW, frame=3), None)
    assert [one["frame"] for one in sink._waiting] == [1, 2, 3]
    begin = time.monotonic()
    sink.close()
    assert time.monotonic() - begin < 3


@pytest.mark.parametrize(
    ("settings", "named"),
    [({"qos": 3}, "qos is 3"), ({"port": 0}, "port 0"), ({"prefix": "a/#"}, "no topic"), ({"prefix": ""}, "no topic")],
)
def test_settings_that_cannot_work_are_named(settings, named):
    with pytest.raises(UserError, match=named):
        MqttConfig(**settings)


def test_without_the_package_the_remedy_is_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(UserError, match="needs the package aiomqtt; pip install") as caught:
        MqttConfig("localhost")
    assert caught.value.code == "unavailable"


def test_a_password_comes_from_a_file(tmp_path):
    (tmp_path / "password").write_text("secret\n")
    assert MqttConfig(password_file=tmp_path / "password").password() == "secret" and MqttConfig().password() is None
    with pytest.raises(UserError, match="cannot be read"):
        MqttConfig(password_file=tmp_path / "none").password()
