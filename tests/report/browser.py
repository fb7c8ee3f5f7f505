"""Chromium without a window, spoken to over a pipe: the report as a reader has it, at any width, in the dark."""

import base64
import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
OPTIONS = (
    "--headless --no-sandbox --disable-gpu --disable-background-networking --hide-scrollbars --no-first-run "
    "--disable-dev-shm-usage --remote-debugging-pipe"
)
# Chromium reads commands from descriptor 3 and answers on 4, of which either may be the other's.
HAND_OVER = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(end), fcntl.F_DUPFD, 10) for end in sys.argv[1:3]]
os.dup2(ends[0], 3)
os.dup2(ends[1], 4)
os.execv(sys.argv[3], sys.argv[3:])
"""
PATIENCE = 30.0  # [s] for an answer on a busy machine


class Browser:
    """One tab of a browser.  What pages say on the console, and what they fail to load, is kept in `said`."""

    def __init__(self, folder: Path) -> None:
        theirs, self._out = os.pipe()
        self._in, ours = os.pipe()
        command = [str(CHROMIUM), *OPTIONS.split(), f"--user-data-dir={folder / 'profile'}", "about:blank"]
        self._process = subprocess.Popen(
            [sys.executable, "-c", HAND_OVER, str(theirs), str(ours), *command],
            pass_fds=(theirs, ours), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(theirs)
        os.close(ours)
        self._calls, self._rest, self._session = 0, b"", ""
        self.said: list[str] = []
        targets = self.call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def close(self) -> None:
        """End the browser."""
        with suppress(OSError):
            os.close(self._out)
        self._process.terminate()
        self._process.wait(PATIENCE)
        os.close(self._in)

    def call(self, method: str, **parameters: Any) -> Any:
        """Send one command of the DevTools protocol; returns its result."""
        self._calls += 1
        message = {"id": self._calls, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        answer = self._read(lambda read: read.get("id") == self._calls)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def open(self, file: Path, width: int = 1440, height: int = 900, dark: bool = False, script: bool = True) -> None:
        """Open a file in a window of a size [px]."""
        self.said.clear()
        phone = width < 600
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone)
        self.call("Emulation.setTouchEmulationEnabled", enabled=phone)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", media="", features=[scheme])
        self.call("Emulation.setScriptExecutionDisabled", value=not script)
        # The load event of an earlier page may still be on its way, so the new one is told by its frame's loader.
        self.call("Page.navigate", url=file.as_uri())
        self._read(lambda read: read.get("method") == "Page.loadEventFired")

    def run(self, expression: str) -> Any:
        """The value of a JavaScript expression in the page, awaited where it is a promise."""
        done = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in done:
            raise RuntimeError(done["exceptionDetails"]["exception"].get("description", expression))
        return done["result"].get("value")

    def settle(self) -> None:
        """Wait until what is scrolled to has been drawn; without a script in the page, nobody could say so."""
        time.sleep(0.3)
        self.call("Page.getLayoutMetrics")

    def photograph(self, file: Path, whole: bool = False) -> None:
        """Save what is to be seen, or the whole page."""
        picture = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        file.write_bytes(base64.b64decode(picture["data"]))

    def _read(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        while True:
            while b"\0" not in self._rest:
                if not select.select([self._in], [], [], PATIENCE)[0]:
                    raise TimeoutError("the browser does not answer")
                more = os.read(self._in, 1 << 20)
                if not more:
                    raise RuntimeError("the browser ended")
                self._rest += more
            line, _, self._rest = self._rest.partition(b"\0")
            read = json.loads(line)
            self._hear(read)
            if wanted(read):
                return dict(read)

    def _hear(self, read: dict[str, Any]) -> None:
        method, parameters = read.get("method"), read.get("params", {})
        if method == "Runtime.consoleAPICalled":
            self.said.append(
                f"{parameters['type']}: {[a.get('value', a.get('description')) for a in parameters['args']]}"
            )
        elif method == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.said.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Log.entryAdded":
            self.said.append(parameters["entry"]["text"])
