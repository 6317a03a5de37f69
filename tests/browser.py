"""Control of headless Chromium over W3C WebDriver."""

import base64
import json
import os
import re
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

PROGRAMS = ("chromium", "chromedriver")
OPTIONS = (
    "--headless=new --no-sandbox --disable-gpu --disable-dev-shm-usage --no-first-run --disable-sync "
    "--disable-background-networking --disable-component-update --hide-scrollbars"
)


def missing() -> str | None:
    """Return the reason why no browser is available, or None."""
    lacking = [name for name in PROGRAMS if shutil.which(name) is None]
    return f"{lacking[0]} is not installed (apt-get install chromium chromium-driver)" if lacking else None


class Browser:
    """A browser window: ``driver`` is the address of chromedriver, ``profile`` the folder for the browser's files."""

    def __init__(self, driver: str, profile: Path) -> None:
        self.driver = driver
        arguments = [*OPTIONS.split(), f"--user-data-dir={profile}"]
        chrome = {"binary": shutil.which("chromium"), "args": arguments}
        wanted = {"browserName": "chrome", "goog:chromeOptions": chrome, "goog:loggingPrefs": {"browser": "ALL"}}
        found = self._call("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
        self.session = f"/session/{found['sessionId']}"

    def _call(self, method: str, place: str, content: dict[str, Any] | None = None) -> Any:
        data = None if content is None else json.dumps(content).encode()
        request = urllib.request.Request(self.driver + place, data, {"Content-Type": "application/json"}, method=method)
        with urllib.request.urlopen(request, timeout=120) as answer:
            return json.loads(answer.read())["value"]

    def size(self, width: int, height: int, scale: float = 1.0) -> None:
        """Set the page size in CSS pixels, and the device pixel ratio."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": False}
        command = {"cmd": "Emulation.setDeviceMetricsOverride", "params": metrics}
        self._call("POST", f"{self.session}/goog/cdp/execute", command)

    def open(self, url: str) -> None:
        self._call("POST", f"{self.session}/url", {"url": url})

    def run(self, script: str) -> Any:
        """Return the result of a script that runs in the page."""
        return self._call("POST", f"{self.session}/execute/sync", {"script": script, "args": []})

    def wait_for(self, condition: str, seconds: float = 60.0) -> Any:
        """Wait until an expression is true, and return its value."""
        ends = time.monotonic() + seconds
        while not (found := self.run(f"return {condition}")):
            assert time.monotonic() < ends, f"{condition} did not become true within {seconds:g} s: {self.problems()}"
            time.sleep(0.05)
        return found

    def picture(self) -> bytes:
        """Return a screenshot as PNG."""
        return base64.b64decode(self._call("GET", f"{self.session}/screenshot"))

    def problems(self) -> list[str]:
        """Return errors and warnings of the page since the last call."""
        logged = self._call("POST", f"{self.session}/se/log", {"type": "browser"})
        return [one["message"] for one in logged if one["level"] in ("SEVERE", "WARNING")]

    def close(self) -> None:
        self._call("DELETE", self.session)


@contextmanager
def opened(profile: Path) -> Iterator[Browser]:
    """Yield a browser with an empty profile."""
    environment = {name: value for name, value in os.environ.items() if "proxy" not in name.lower()}
    pipes: Any = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
    with subprocess.Popen([PROGRAMS[1], "--port=0"], env=environment, **pipes) as driver:
        try:
            assert driver.stdout is not None
            port = next(found[1] for line in driver.stdout if (found := re.search(r"started.*on port (\d+)", line)))
            browser = Browser(f"http://127.0.0.1:{port}", profile)
            try:
                yield browser
            finally:
                browser.close()
        finally:
            driver.terminate()
