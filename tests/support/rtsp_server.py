"""A small RTSP camera on loopback: JPEG over RTP (RFC 2435) inside the RTSP connection, with RTCP sender reports."""

from __future__ import annotations

import socket
import socketserver
import struct
import threading
import time
from collections.abc import Callable

import cv2
import numpy as np

_RATE = 90_000
"""Ticks a second of RTP's clock for video."""
_NTP = 2_208_988_800
"""Seconds from 1900 to 1970."""
_SSRC = 7
_MOST = 1200
"""Bytes of scan data in a packet."""


class Camera:
    """Plays pictures at a rate to whoever asks; `url` is where.

    Args:
        picture: RGB bytes by number; sides are multiples of 8.
        fps: pictures a second.
        clock_s: added to the wall clock of its reports.
        most: pictures after which a connection is closed; None never.
    """

    def __init__(
        self, picture: Callable[[int], np.ndarray], fps: float, *, clock_s: float = 0.0, most: int | None = None
    ) -> None:
        self.asked: list[str] = []
        self._ended = threading.Event()
        outer = self

        class Handler(socketserver.StreamRequestHandler):
            def handle(self) -> None:
                while not outer._ended.is_set():
                    lines = []
                    while (line := self.rfile.readline().decode().strip()) or not lines:
                        if not line:
                            return
                        lines.append(line)
                    method, headers = lines[0].split()[0], dict(one.split(": ", 1) for one in lines[1:])
                    outer.asked.append(method)
                    self.wfile.write(_answer(method, headers["CSeq"]))
                    if method == "PLAY":
                        outer._play(self.connection, picture, fps, clock_s, most)
                        return

        class Server(socketserver.ThreadingTCPServer):
            daemon_threads = allow_reuse_address = True

        self._server = Server(("127.0.0.1", 0), Handler)
        self.url = f"rtsp://user:secret@127.0.0.1:{self._server.server_address[1]}/live?key=secret"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def _play(self, connection: socket.socket, picture, fps: float, clock_s: float, most: int | None) -> None:
        begin, sequence = time.time(), 0
        for number in range(10**9 if most is None else most):
            if self._ended.wait(max(begin + number / fps - time.time(), 0.0)):
                break
            ticks = round(number * _RATE / fps) + 1000
            packets = _report(begin + number / fps + clock_s, ticks)
            for payload, last in _jpeg_payloads(picture(number)):
                header = struct.pack(">BBHII", 0x80, 26 | last << 7, sequence & 0xFFFF, ticks, _SSRC)
                packets += b"$\0" + struct.pack(">H", len(header + payload)) + header + payload
                sequence += 1
            try:
                connection.sendall(packets)
            except OSError:
                return

    def close(self) -> None:
        """Stop."""
        self._ended.set()
        self._server.shutdown()
        self._server.server_close()


def _answer(method: str, number: str) -> bytes:
    body, more = "", ""
    if method == "DESCRIBE":
        body = "v=0\r\no=- 1 1 IN IP4 127.0.0.1\r\ns=camera\r\nt=0 0\r\nm=video 0 RTP/AVP 26\r\na=control:track\r\n"
        more = f"Content-Type: application/sdp\r\nContent-Length: {len(body)}\r\n"
    elif method == "SETUP":
        more = "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\nSession: 1\r\n"
    elif method == "OPTIONS":
        more = "Public: OPTIONS, DESCRIBE, SETUP, PLAY\r\n"
    else:
        more = "Session: 1\r\n"
    return f"RTSP/1.0 200 OK\r\nCSeq: {number}\r\n{more}\r\n{body}".encode()


def _report(wall_s: float, ticks: int) -> bytes:
    """A sender report: the wall clock at a moment of RTP's clock (RFC 3550, §6.4.1)."""
    whole = int(wall_s)
    fraction = int((wall_s - whole) * 2**32)
    body = struct.pack(">BBHIIIIII", 0x80, 200, 6, _SSRC, whole + _NTP, fraction, ticks, 1, 1)
    return b"$\1" + struct.pack(">H", len(body)) + body


def _jpeg_payloads(image: np.ndarray) -> list[tuple[bytes, bool]]:
    """A picture in packets, and whether each is its last."""
    coded = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
    tables, at, height, width = b"", 2, *image.shape[:2]
    while coded[at + 1] != 0xDA:  # start of scan
        length = struct.unpack(">H", coded[at + 2 : at + 4])[0]
        segment = coded[at + 4 : at + 2 + length]
        if coded[at + 1] == 0xDB:  # quantisation tables, each behind a byte with its number
            tables += b"".join(segment[i + 1 : i + 65] for i in range(0, len(segment), 65))
        at += 2 + length
    scan = coded[at + 2 + struct.unpack(">H", coded[at + 2 : at + 4])[0] : -2]
    found = []
    for offset in range(0, len(scan), _MOST):
        header = struct.pack(">I", offset) + bytes([1, 255, width // 8, height // 8])  # type 1: 4:2:0
        if offset == 0:
            header += struct.pack(">BBH", 0, 0, len(tables)) + tables
        found.append((header + scan[offset : offset + _MOST], offset + _MOST >= len(scan)))
    return found
