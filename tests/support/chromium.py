"""Chromium without a window, driven over its debugging pipe; tests skip where it is not installed."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

PROGRAM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
needs_chromium = pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")
_FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-extensions",
    "--remote-debugging-pipe",
]
_PATIENCE_S = 120


class Tab:
    """One page. `events` are what Chromium reported of it so far."""

    def __init__(self, read: int, write: int) -> None:
        self._read, self._write, self._buffer, self._number = read, write, b"", 0
        self._session: str | None = None
        self.events: list[dict[str, Any]] = []
        (target,) = [t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page"]
        attached = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command of the DevTools protocol and its answer."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        message |= {"sessionId": self._session} if self._session else {}
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != self._number:
            self.events.append(answer)
        assert "error" not in answer, f"{method}: {answer['error']}"
        return answer["result"]

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], _PATIENCE_S)
            assert ready, "Chromium does not answer"
            self._buffer += os.read(self._read, 1 << 20)
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)

    def resize(self, width: int, height: int, *, dark: bool = False) -> None:
        """Size of the page in CSS pixels, and which colours its reader prefers."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 500
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def open(self, path: Path, fragment: str = "") -> None:
        """Load a file afresh and wait until it is drawn."""
        for url in ("about:blank", f"{path.as_uri()}#{fragment}"):
            self.events = [event for event in self.events if event.get("method") != "Page.loadEventFired"]
            self.call("Page.navigate", url=url)
            while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
                self.events.append(self._next())

    def run(self, script: str) -> Any:
        """Value of an expression of JavaScript, promises awaited."""
        answer = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def settle(self) -> None:
        """Wait until what was asked for is drawn."""
        self.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")

    def picture(self, selector: str = "html") -> np.ndarray:
        """RGB bytes of what an element shows."""
        box = self.run(
            f"(r => [r.x + scrollX, r.y + scrollY, r.width, r.height])"
            f"(document.querySelector({json.dumps(selector)}).getBoundingClientRect())"
        )
        clip = dict(zip(("x", "y", "width", "height"), box, strict=True)) | {"scale": 1}
        shot = self.call("Page.captureScreenshot", format="png", clip=clip, captureBeyondViewport=True)
        data = np.frombuffer(base64.b64decode(shot["data"]), np.uint8)
        return cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)

    def complaints(self) -> list[str]:
        """Exceptions, messages of the console, and requests that are neither the file nor in it."""
        found = []
        for event in self.events:
            method, told = event.get("method"), event.get("params", {})
            if method in ("Runtime.exceptionThrown", "Runtime.consoleAPICalled"):
                found.append(f"{method}: {told}")
            elif method == "Log.entryAdded" and "GPU stall due to ReadPixels" not in told["entry"]["text"]:
                found.append(told["entry"]["text"])  # that one is said of every screenshot
            elif method == "Network.requestWillBeSent":
                url = told["request"]["url"]
                found += [] if url.startswith(("data:", "file:", "about:")) else [f"request: {url}"]
        return found


@contextmanager
def chromium(profile: Path, *flags: str) -> Iterator[Tab]:
    """A fresh Chromium whose profile is kept in an empty folder."""
    (their_read, write), (read, their_write) = os.pipe(), os.pipe()
    command = [str(PROGRAM), f"--user-data-dir={profile}", *_FLAGS, *flags, "about:blank"]
    # The pipe's ends must be descriptors 3 and 4; a shell puts them there, whatever their numbers.
    shell = ["sh", "-c", f'exec "$@" 3</dev/fd/{their_read} 4>/dev/fd/{their_write}', "sh", *command]
    process = subprocess.Popen(
        shell, pass_fds=(their_read, their_write), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    os.close(their_read)
    os.close(their_write)
    try:
        yield Tab(read, write)
    finally:
        process.terminate()
        process.wait()
        os.close(read)
        os.close(write)
        time.sleep(0.1)  # its helpers write into the profile until they notice
