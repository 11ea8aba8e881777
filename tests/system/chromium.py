"""A headless Chromium driven through its debugging pipe: real time, no port, no driver."""

from __future__ import annotations

import base64
import contextlib
import json
import os
import select
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FLAGS = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


class Page:
    """One open page."""

    def __init__(self, inward: int, outward: int) -> None:
        self._in, self._out = inward, outward
        self._buffer = b""
        self._number = 0
        self._session: str | None = None

    def open(self, url: str) -> None:
        target = self.call("Target.createTarget", url=url)["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]

    def picture(self) -> bytes:
        """What is seen now, as PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def call(self, method: str, timeout: float = 60.0, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._in, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + timeout
        while True:
            while b"\0" in self._buffer:
                line, _, self._buffer = self._buffer.partition(b"\0")
                answer = json.loads(line)
                if answer.get("id") == self._number:
                    assert "error" not in answer, answer
                    return dict(answer["result"])
            ready, _, _ = select.select([self._out], [], [], max(0.0, deadline - time.monotonic()))
            assert ready, f"Chromium does not answer {method} within {timeout:g} s"
            self._buffer += os.read(self._out, 1 << 20)


@contextlib.contextmanager
def browse(chromium: str, url: str, profile: Path, size: str = "1600,1000") -> Iterator[Page]:
    """Open a page; Chromium reads commands from file descriptor 3 and answers on 4."""
    read_in, write_in = os.pipe()
    read_out, write_out = os.pipe()
    # the shell puts the pipes' ends where Chromium expects them
    script = f'exec "$@" 3<&{read_in} 4>&{write_out}'
    command = [chromium, *FLAGS, f"--window-size={size}", f"--user-data-dir={profile}", "--remote-debugging-pipe"]
    process = subprocess.Popen(
        ["bash", "-c", script, "bash", *command],
        pass_fds=(read_in, write_out),
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    os.close(read_in)
    os.close(write_out)
    try:
        page = Page(write_in, read_out)
        page.open(url)
        yield page
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        os.close(write_in)
        os.close(read_out)
