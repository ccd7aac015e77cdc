"""Network cameras: RTSP, HTTP and what else FFmpeg opens, through PyAV (extra `video`); a thread a camera."""

from __future__ import annotations

import importlib.util
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal
from urllib.parse import urlsplit

import numpy as np
from jaxtyping import UInt8

from aerojax.capture.format import Capture, CaptureCamera, read_network
from aerojax.capture.frames import CameraView, straight_image
from aerojax.core.config import require_at_least
from aerojax.core.errors import UserError
from aerojax.segment.base import Preview
from aerojax.serve.intake import Intake
from aerojax.serve.notices import SourceFailed
from aerojax.serve.pictures import Picture
from aerojax.serve.retries import RetryConfig
from aerojax.serve.sources.base import SourceConfig

SCHEMES = ("rtsp", "rtsps", "rtmp", "http", "https", "srt", "udp", "rtp")
"""Addresses that may be opened; FFmpeg would open files and lists of further addresses too."""
_PROTOCOLS = "rtsp,rtsps,rtmp,http,https,srt,udp,rtp,tcp,tls,crypto"
_SMOOTHING = 0.01
"""Share of a picture's own delay in the clock's offset: jitter of the network is averaged, drift of clocks followed."""


@dataclass(frozen=True)
class StreamsConfig(SourceConfig):
    """Cameras of the network as streams.

    urls: one a camera, in the order of capture.json: rtsp://…, http://… and others.
    transport: of RTSP.
    clock: whose times pictures have: `sender`, the camera's own wall clock where its stream says it (RTCP reports), and
        otherwise the moment of arrival; or `arrival` always.
    timeout_s: after which a stream that cannot be opened, or gives nothing, is opened anew.
    retry: waits before it is.
    """

    name: Literal["streams"] = "streams"
    urls: tuple[str, ...] = ()
    transport: Literal["tcp", "udp"] = "tcp"
    clock: Literal["sender", "arrival"] = "sender"
    timeout_s: float = 10.0
    retry: RetryConfig = field(default_factory=RetryConfig)

    def __post_init__(self) -> None:
        require_at_least(self, "timeout_s", least=0.1)

    def build(self, folder: Path) -> Streams:
        """The member that opens these streams."""
        if importlib.util.find_spec("av") is None:
            raise UserError("unavailable", "sources=streams needs the package av", "pip install 'aerojax[video]'")
        site = read_network(folder)
        if len(self.urls) != len(site.cameras):
            problem = f"source.urls has {len(self.urls)} addresses, {folder}/capture.json {len(site.cameras)} cameras"
            raise UserError("mismatch", problem, "give one address a camera, in that order: source.urls=[rtsp://…,…]")
        for url in self.urls:
            if urlsplit(url).scheme not in SCHEMES:
                problem = f"source.urls: {redacted(url)} is of no kind that may be opened"
                raise UserError("invalid", problem, f"use {', '.join(SCHEMES)}")
        return Streams(self, site)


def redacted(url: str) -> str:
    """An address without the user's name and password, and without its query, which may hold a key."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}{parts.path}"


@dataclass(frozen=True)
class Streams:
    """Opens streams again and again."""

    config: StreamsConfig
    site: Capture
    numbered: bool = False

    def preview(self) -> Preview | None:
        """Nothing: all of it is yet to come."""
        return None

    def run(self, intake: Intake, since: Mapping[int, int], stop: threading.Event) -> None:
        """Put pictures as they are decoded; `since` means nothing here."""
        threads = [
            threading.Thread(target=self._follow, args=(camera, intake, stop), daemon=True, name=f"camera {camera}")
            for camera in range(len(self.site.cameras))
        ]
        for one in threads:
            one.start()
        stop.wait()
        for one in threads:
            one.join(timeout=2.0)

    def _follow(self, camera: int, intake: Intake, stop: threading.Event) -> None:
        """One camera's stream, opened anew whenever it ends."""
        import av

        url, failures = self.config.urls[camera], 0
        while not stop.is_set():
            text = "the stream ended"
            try:
                for picture in self._pictures(camera, url, stop):
                    intake.put(picture)
                    failures = 0
            except (av.FFmpegError, OSError, ValueError) as error:
                text = getattr(error, "strerror", None) or str(error) or type(error).__name__
            if stop.is_set():
                return
            failures += 1
            delay = self.config.retry.delay_s(failures)
            intake.note(SourceFailed(camera, f"{redacted(url)}: {text}", delay))
            stop.wait(delay)

    def _pictures(self, camera: int, url: str, stop: threading.Event) -> Iterator[Picture]:
        import av

        options = {"rtsp_transport": self.config.transport} if url.startswith("rtsp") else {}
        options |= {"fflags": "nobuffer", "protocol_whitelist": _PROTOCOLS}
        limit = self.config.timeout_s
        with av.open(url, options=options, timeout=(limit, limit)) as container:
            if not container.streams.video:
                raise ValueError("no video")
            stream = container.streams.video[0]
            stream.thread_type = "SLICE"  # threads of whole frames would each hold one back
            clock = _Clock(self.config.clock == "sender")
            for frame in container.decode(stream):
                if stop.is_set():
                    return
                pixels = frame.to_ndarray(format="rgb24")
                load = partial(_load, pixels, self.site.cameras[camera], redacted(url))
                yield Picture(camera, clock.time_s(frame, container), None, load)


class _Clock:
    """Seconds since 1970 of a stream's pictures."""

    def __init__(self, sender: bool) -> None:
        self._sender = sender
        self._offset: float | None = None
        self._zero = time.time() - time.monotonic()  # the host's clock may be set while the stream runs

    def time_s(self, frame: Any, container: Any) -> float:
        """Of one frame: by the sender's clock, or by arrivals that are averaged over the stream's own stamps."""
        now = self._zero + time.monotonic()
        if frame.pts is None or frame.time_base is None:
            return now
        stamp = float(frame.pts * frame.time_base)
        began = container.start_time_realtime
        if self._sender and began is not None and began > 0:
            return began / 1e6 + stamp
        delay = now - stamp
        if self._offset is None or abs(delay - self._offset) > 1.0:
            self._offset = delay
        self._offset += _SMOOTHING * (delay - self._offset)
        return self._offset + stamp


def _load(pixels: UInt8[np.ndarray, "height width 3"], camera: CaptureCamera, source: str) -> CameraView:
    return straight_image(pixels, camera, source), None, None
