"""A page with a live top view, and metrics, over HTTP; on this machine alone unless there is a token."""

from __future__ import annotations

import hmac
import ipaddress
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from aerojax.core.errors import UserError
from aerojax.serve.figures import Health
from aerojax.serve.messages import Message, Sighting, health_message
from aerojax.serve.sinks.board import Board
from aerojax.serve.sinks.prometheus import CONTENT_TYPE, exposition
from aerojax.view.live.page import live_page

_SHORTEST_TOKEN = 16
"""Characters; fewer can be guessed."""
_PATIENCE_S = 10.0
"""After which a client that says nothing is let go."""


@dataclass(frozen=True)
class WebConfig:
    """The page and `/metrics`.

    port: where they are served; any free one if 0, nowhere if None.
    host: address that is listened to. token_file: its first line is the token that every request must bring, as
        `?token=…` or `Authorization: Bearer …`; needed where the address is not this machine's own.
    """

    port: int | None = None
    host: str = "127.0.0.1"
    token_file: Path | None = None

    def __post_init__(self) -> None:
        if self.port is not None and not 0 <= self.port < 2**16:
            raise UserError("out-of-range", f"web.port is {self.port}", "give a number from 0 to 65535")
        if self.port is not None and self.token_file is None and not is_loopback(self.host):
            problem = f"web.host={self.host} is open to other machines, and web.token_file is not set"
            raise UserError("invalid", problem, "name a file with a token, or leave web.host at 127.0.0.1")

    def token(self) -> str | None:
        """What requests must bring.

        Raises:
            UserError: the file cannot be read, or its token is short.
        """
        if self.token_file is None:
            return None
        try:
            token = (self.token_file.read_text(encoding="utf-8").splitlines() or [""])[0].strip()
        except (OSError, UnicodeDecodeError) as error:
            problem = f"web.token_file={self.token_file}: cannot be read ({error})"
            raise UserError("unreadable", problem, "write the token into it as one line of text") from None
        if len(token) < _SHORTEST_TOKEN:
            problem = f"web.token_file={self.token_file}: its token has {len(token)} characters"
            raise UserError(
                "invalid", problem, f"write {_SHORTEST_TOKEN} or more, as `openssl rand -hex 16` makes them"
            )
        return token


def is_loopback(host: str) -> bool:
    """Whether an address is this machine's own, for nobody else to reach."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class Web:
    """The server; `address` is where it listens."""

    name, vital = "web", False

    def __init__(self, config: WebConfig) -> None:
        self._board, self._health = Board(), b""
        token = config.token()
        page, headers = live_page()

        class Handler(_Handler):
            answers = _Answers(token, page, headers, self._board, lambda: self._health)

        class Server(ThreadingHTTPServer):
            address_family = socket.AF_INET6 if ":" in config.host else socket.AF_INET
            daemon_threads = True
            allow_reuse_address = True

        try:
            self._server = Server((config.host, config.port or 0), Handler)
        except OSError as error:
            problem = f"web.port={config.port}: {config.host} cannot be listened to ({error.strerror or error})"
            raise UserError("occupied", problem, "choose another port, or end what uses it") from None
        host = f"[{config.host}]" if ":" in config.host else config.host
        self.address = f"http://{host}:{self._server.server_address[1]}/"
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True, name="web")
        self._thread.start()

    def send(self, message: Message, sighting: Sighting | None) -> None:
        """Put a message on the page."""
        self._board.take(message)

    def see(self, health: Health) -> None:
        """Put figures on the page and into the metrics."""
        self._board.see(health_message("health", datetime.now(UTC), health))
        self._health = exposition(health).encode()

    def close(self) -> None:
        """Stop listening."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Answers:
    """What the server says, by path."""

    def __init__(
        self, token: str | None, page: bytes, headers: dict[str, str], board: Board, metrics: Callable[[], bytes]
    ) -> None:
        self._token, self._page, self._headers = token, page, headers
        self._board, self._metrics = board, metrics

    def allowed(self, query: str, authorization: str, host: str) -> bool:
        """Whether a request brings the token; without one, whether it was sent to this machine by name.

        A page from elsewhere could have its own name lead here; its requests then carry that name (DNS rebinding).
        """
        if self._token is None:
            return is_loopback(urlsplit(f"//{host}").hostname or "")
        given = authorization.removeprefix("Bearer ") if authorization else parse_qs(query).get("token", [""])[0]
        return hmac.compare_digest(given.encode("utf-8", "replace"), self._token.encode())

    def answer(self, path: str) -> tuple[int, str, bytes, dict[str, str]]:
        """Status, type, body and more headers."""
        if path == "/":
            return 200, "text/html; charset=utf-8", self._page, self._headers
        if path == "/state":
            return 200, "application/json", self._board.content(), {}
        if path == "/metrics":
            return 200, CONTENT_TYPE, self._metrics(), {}
        return 404, "text/plain; charset=utf-8", b"there is /, /state and /metrics\n", {}


class _Handler(BaseHTTPRequestHandler):
    answers: _Answers
    timeout = _PATIENCE_S
    server_version, sys_version = "aerojax", ""

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        authorization, host = (self.headers.get(key, "") for key in ("Authorization", "Host"))
        if not self.answers.allowed(parts.query, authorization, host):
            refusal = b"a token is needed, as ?token=...; without one, only this machine may ask\n"
            return self._send(403, "text/plain; charset=utf-8", refusal, {})
        self._send(*self.answers.answer(parts.path))

    def _send(self, status: int, kind: str, body: bytes, more: dict[str, str]) -> None:
        self.send_response(status)
        fixed = {
            "Content-Type": kind,
            "Content-Length": str(len(body)),
            "Cache-Control": "no-store",
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "X-Frame-Options": "DENY",
        }
        for key, value in {**fixed, **more}.items():
            self.send_header(key, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Nothing: tokens stand in addresses."""
