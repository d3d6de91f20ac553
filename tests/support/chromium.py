"""Chromium without a screen, spoken to through a pair of pipes: what a page shows, asks for, and complains of."""

from __future__ import annotations

import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

PROGRAM = shutil.which("chromium") or shutil.which("google-chrome")
_TIMEOUT_S = 60.0


@dataclass
class Browser:
    """A browser with one page; ``events`` holds all that it told, by method."""

    to: int
    back: int
    session: str = ""
    count: int = 0
    unread: bytes = b""
    events: list[dict[str, Any]] = field(default_factory=list)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol and return its result."""
        self.count += 1
        message: dict[str, Any] = {"id": self.count, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.to, json.dumps(message).encode() + b"\0")
        for answer in self._messages():
            if answer.get("id") == self.count:
                assert "error" not in answer, answer
                return answer["result"]
        raise AssertionError("unreachable")

    def open(self, page: Path, width: int) -> None:
        """Show a page in a window of a width and wait until all of it is there."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 600
        )
        loaded = self._loads()
        self.call("Page.navigate", url=page.as_uri())
        if self._loads() == loaded:
            for event in self._messages():
                if event.get("method") == "Page.loadEventFired":
                    return

    def _loads(self) -> int:
        return sum(event["method"] == "Page.loadEventFired" for event in self.events)

    def evaluate(self, expression: str) -> Any:
        """Return the value of an expression in the page."""
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def requests(self) -> list[str]:
        """Return all addresses that were asked for, but those within the page."""
        urls = [it["params"]["request"]["url"] for it in self.events if it["method"] == "Network.requestWillBeSent"]
        return [url for url in urls if not url.startswith("data:")]

    def complaints(self) -> list[dict[str, Any]]:
        """Return errors, warnings and exceptions."""
        methods = ("Log.entryAdded", "Runtime.consoleAPICalled", "Runtime.exceptionThrown")
        return [event for event in self.events if event["method"] in methods]

    def _messages(self) -> Iterator[dict[str, Any]]:
        deadline_s = time.monotonic() + _TIMEOUT_S
        while True:
            while b"\0" in self.unread:
                message, _, self.unread = self.unread.partition(b"\0")
                answer = json.loads(message)
                if "method" in answer:
                    self.events.append(answer)
                yield answer
            ready, _, _ = select.select([self.back], [], [], max(0.0, deadline_s - time.monotonic()))
            assert ready, "Chromium does not answer"
            data = os.read(self.back, 1 << 20)
            assert data, "Chromium has ended"
            self.unread += data


@contextmanager
def chromium(folder: Path) -> Iterator[Browser]:
    """Start Chromium with an empty profile in ``folder``; it ends with the block."""
    assert PROGRAM, "Chromium is missing: apt-get install chromium"
    in_read, in_write = os.pipe()
    out_read, out_write = os.pipe()

    def at_3_and_4() -> None:
        # First out of the way: a pipe may have been given one of the two numbers.
        read, write = (os.dup(each) for each in (in_read, out_write))
        spare = [os.dup2(read, 13), os.dup2(write, 14)]
        os.dup2(spare[0], 3)
        os.dup2(spare[1], 4)

    command = [PROGRAM, "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", "--no-first-run",
               f"--user-data-dir={folder}", "about:blank"]  # fmt: skip
    with subprocess.Popen(
        command, preexec_fn=at_3_and_4, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        os.close(in_read)
        os.close(out_write)
        try:
            browser = Browser(in_write, out_read)
            target = browser.call("Target.createTarget", url="about:blank")["targetId"]
            browser.session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            for domain in ("Page", "Network", "Log", "Runtime"):
                browser.call(f"{domain}.enable")
            browser.events.clear()
            yield browser
        finally:
            process.terminate()
            os.close(in_write)
            os.close(out_read)
            with suppress(subprocess.TimeoutExpired):
                process.wait(10.0)
            process.kill()
