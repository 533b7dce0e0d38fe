"""A headless Chromium for tests, driven by chromedriver's HTTP interface (W3C WebDriver)."""

from __future__ import annotations

import base64
import contextlib
import json
import shutil
import socket
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.error import HTTPError, URLError

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
)
_START_SECONDS = 30.0
KEYS = {
    "ArrowLeft": "\ue012",
    "ArrowUp": "\ue013",
    "ArrowRight": "\ue014",
    "Tab": "\ue004",
    "Enter": "\ue007",
}


class Browser:
    """One window."""

    def __init__(self, session: str) -> None:
        self._session = session

    def open(self, page: Path, width: int, height: int = 900) -> None:
        """Open a file in a window of this size, as a phone's would be if it is narrow."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.devtools("Emulation.setDeviceMetricsOverride", **metrics)
        self._post("url", url=page.absolute().as_uri())

    def wait(self, condition: str, seconds: float = 20.0) -> Any:
        """Wait until a JavaScript expression is true and return its value."""
        until = time.monotonic() + seconds
        while not (value := self.run(f"return {condition}")):
            assert time.monotonic() < until, f"never true: {condition}\n{self.complaints()}"
            time.sleep(0.05)
        return value

    def run(self, script: str) -> Any:
        """Run JavaScript and return what it returns."""
        return self._post("execute/sync", script=script, args=[])

    def point_at(self, x: float, y: float, click: bool = False) -> None:
        """Move the mouse to a place of the window, and click there if asked to."""
        steps: list[dict[str, Any]] = [
            {"type": "pointerMove", "duration": 50, "x": round(x), "y": round(y)}
        ]
        if click:
            steps += [{"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        self._post("actions", actions=[{"type": "pointer", "id": "mouse", "actions": steps}])

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag the mouse from one place of the window to another."""
        steps: list[dict[str, Any]] = [
            {"type": "pointerMove", "duration": 50, "x": round(start[0]), "y": round(start[1])},
            {"type": "pointerDown", "button": 0},
            {"type": "pointerMove", "duration": 200, "x": round(end[0]), "y": round(end[1])},
            {"type": "pointerUp", "button": 0},
        ]
        self._post("actions", actions=[{"type": "pointer", "id": "mouse", "actions": steps}])

    def press(self, *names: str) -> None:
        """Press keys one after the other."""
        strokes = [
            {"type": kind, "value": KEYS.get(name, name)}
            for name in names
            for kind in ("keyDown", "keyUp")
        ]
        self._post("actions", actions=[{"type": "key", "id": "keyboard", "actions": strokes}])

    def screenshot(self, path: Path, full: bool = False) -> None:
        """Write a PNG of the window, or of the whole page."""
        options = {"captureBeyondViewport": True} if full else {}
        data = self.devtools("Page.captureScreenshot", format="png", **options)["data"]
        path.write_bytes(base64.b64decode(data))

    def complaints(self) -> list[str]:
        """Return warnings and errors of the console since the last call."""
        entries = self._post("se/log", type="browser")
        return [e["message"] for e in entries if e["level"] in ("WARNING", "SEVERE")]

    def requests(self) -> list[str]:
        """Return the addresses that pages have asked for since the last call."""
        events = [
            json.loads(e["message"])["message"] for e in self._post("se/log", type="performance")
        ]
        sent = [e["params"] for e in events if e["method"] == "Network.requestWillBeSent"]
        return [e["request"]["url"] for e in sent]

    def devtools(self, method: str, **parameters: Any) -> Any:
        """Call a method of the DevTools protocol."""
        return self._post("goog/cdp/execute", cmd=method, params=parameters)

    def _post(self, path: str, **body: Any) -> Any:
        return _request(f"{self._session}/{path}", body)


@contextlib.contextmanager
def browser(folder: Path) -> Iterator[Browser]:
    """Start Chromium with an empty profile in `folder`; end it, and its driver, afterwards."""
    port = _free_port()
    with (folder / "chromedriver.log").open("wb") as log:
        driver = subprocess.Popen(["chromedriver", f"--port={port}"], stdout=log, stderr=log)
    try:
        address = f"http://127.0.0.1:{port}"
        _await(f"{address}/status")
        options = {
            "args": [*FLAGS, f"--user-data-dir={folder / 'profile'}"],
            "binary": shutil.which("chromium"),
        }
        wishes = {
            "goog:chromeOptions": options,
            "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
        }
        body = {"capabilities": {"alwaysMatch": wishes}}
        session = f"{address}/session/{_request(f'{address}/session', body)['sessionId']}"
        try:
            window = Browser(session)
            window.devtools("Page.navigate", url="about:blank")
            window.requests()  # those of the page that was there first
            yield window
        finally:
            _request(session, None, "DELETE")
    finally:
        driver.terminate()
        driver.wait(10)


def _request(address: str, body: Any, method: str = "POST") -> Any:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(
        address, data, {"Content-Type": "application/json"}, method=method
    )
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        with opener.open(request, timeout=60) as answer:
            return json.loads(answer.read())["value"]
    except HTTPError as error:
        with error:
            raise AssertionError(error.read().decode(errors="replace")[:2000]) from None


def _await(address: str) -> None:
    until = time.monotonic() + _START_SECONDS
    while True:
        try:
            _request(address, None, "GET")
        except (URLError, ConnectionError):
            assert time.monotonic() < until, "chromedriver does not answer"
            time.sleep(0.1)
        else:
            return


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
