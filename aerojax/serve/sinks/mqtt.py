"""Messages to an MQTT broker through aiomqtt (extra `mqtt`): `PREFIX/TYPE`, and `PREFIX/status` for who watches."""

from __future__ import annotations

import asyncio
import importlib.util
import threading
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

from aerojax.core.config import require_at_least
from aerojax.core.errors import UserError
from aerojax.core.files import json_text
from aerojax.serve.figures import Health
from aerojax.serve.messages import Message, Sighting
from aerojax.serve.retries import RetryConfig

_WAITING = 1000
"""Messages that are kept while the broker is away; then the oldest are dropped."""
_POLL_S = 0.02
_PATIENCE_S = 2.0
"""That the last messages have to be sent at the end."""


@dataclass(frozen=True)
class MqttConfig:
    """A broker.

    host: name or address; no broker if None. port: of it. tls: whether the connection is encrypted, and the broker's
        certificate checked. user: name there; none if None. password_file: its first line is the password.
    prefix: of the topics. qos: 0 at most once, 1 at least once, 2 exactly once.
    retry: waits before a broker that is away is tried again.
    """

    host: str | None = None
    port: int = 1883
    tls: bool = False
    user: str | None = None
    password_file: Path | None = None
    prefix: str = "aerojax"
    qos: int = 0
    retry: RetryConfig = field(default_factory=RetryConfig)

    def __post_init__(self) -> None:
        require_at_least(self, "qos", least=0)
        if self.qos > 2 or not 0 < self.port < 2**16:
            raise UserError(
                "out-of-range", f"mqtt: qos is {self.qos}, port {self.port}", "qos is 0 to 2, port 1 to 65535"
            )
        if not self.prefix or set(self.prefix) & {"#", "+", "\0"}:
            raise UserError("invalid", f"mqtt.prefix={self.prefix!r} is no topic", "use names with / between them")
        if self.host is not None and importlib.util.find_spec("aiomqtt") is None:
            raise UserError("unavailable", "mqtt.host needs the package aiomqtt", "pip install 'aerojax[mqtt]'")

    def password(self) -> str | None:
        """The password, if there is one.

        Raises:
            UserError: the file cannot be read.
        """
        if self.password_file is None:
            return None
        try:
            return (self.password_file.read_text(encoding="utf-8").splitlines() or [""])[0]
        except (OSError, UnicodeDecodeError) as error:
            problem = f"mqtt.password_file={self.password_file}: cannot be read ({error})"
            raise UserError("unreadable", problem, "correct the path") from None


class Mqtt:
    """Sends from a thread of its own, so that a slow broker holds nothing up.

    `PREFIX/status` is retained: `online`, and `offline` when the service ends or is gone (last will).
    """

    name, vital = "mqtt", False

    def __init__(self, config: MqttConfig) -> None:
        self._config, self._password = config, config.password()
        self._waiting: deque[Message] = deque(maxlen=_WAITING)
        self._closing = threading.Event()
        self._lost = 0
        self._thread = threading.Thread(target=lambda: asyncio.run(self._connected()), daemon=True, name="mqtt")
        self._thread.start()

    def send(self, message: Message, sighting: Sighting | None) -> None:
        """Put a message in line.

        Raises:
            OSError: the line is full; the oldest message was dropped for this one.
        """
        full = len(self._waiting) == _WAITING
        self._waiting.append(message)
        if full:
            raise BlockingIOError("the broker does not take messages in time")

    def see(self, health: Health) -> None:
        """Figures go with the messages that tell them."""

    def close(self) -> None:
        """Send what waits, for a moment, and end."""
        self._closing.set()
        self._thread.join(timeout=2 * _PATIENCE_S)

    async def _connected(self) -> None:
        """Connect, send, and connect again."""
        import aiomqtt

        config, failures = self._config, 0
        will = aiomqtt.Will(f"{config.prefix}/status", "offline", qos=1, retain=True)
        tls = {"tls_params": aiomqtt.TLSParameters()} if config.tls else {}
        while not self._closing.is_set():
            try:
                async with aiomqtt.Client(
                    str(config.host), config.port, username=config.user, password=self._password, will=will, **tls
                ) as client:
                    failures = 0
                    await client.publish(f"{config.prefix}/status", "online", qos=1, retain=True)
                    await self._sending(client)
                    await client.publish(f"{config.prefix}/status", "offline", qos=1, retain=True)
                    return
            except (aiomqtt.MqttError, OSError):
                failures += 1
                await asyncio.to_thread(self._closing.wait, config.retry.delay_s(failures))

    async def _sending(self, client) -> None:
        """Send until the end; a message leaves the line when it is sent."""
        end = float("inf")
        clock = asyncio.get_running_loop().time
        while clock() < end:
            if self._closing.is_set():
                end = min(end, clock() + _PATIENCE_S)
            if not self._waiting:
                if self._closing.is_set():
                    return
                await asyncio.sleep(_POLL_S)
                continue
            message = self._waiting[0]
            topic = f"{self._config.prefix}/{message['type']}"
            await client.publish(topic, json_text(message, indent=None), qos=self._config.qos)
            if self._waiting and self._waiting[0] is message:
                self._waiting.popleft()
