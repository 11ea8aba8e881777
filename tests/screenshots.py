"""Pictures of the viewer itself, without a display: what a person would see."""

import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from rerun.experimental import ViewerClient

from softseam.replay.show import LOOPBACK, ReplayError, free_port
from softseam.replay.viewer import running


def screenshots(rrd: Path, wanted: Mapping[Path, float], *, size: str = "1600x1000", timeout: float = 60.0) -> None:
    """Draw the viewer at simulation times [s] into PNG files. Needs a Vulkan driver; software will do.

    Raises ReplayError where the viewer does not come up or does not finish loading within `timeout` [s].
    """
    with _headless(rrd, size, timeout) as client:
        for path, at in wanted.items():
            client.set_time("sim_time", duration=at, play_state="paused")
            _settle(client, path, timeout)


@contextmanager
def _headless(rrd: Path, size: str, timeout: float) -> Iterator[ViewerClient]:
    port = free_port(9876)
    arguments = [str(rrd), "--headless", "--bind", LOOPBACK, "--port", str(port), "--window-size", size]
    with running(arguments, silent=True) as process:
        yield _connect(process, port, timeout)


def _connect(process: subprocess.Popen[bytes], port: int, timeout: float) -> ViewerClient:
    """Wait until the viewer answers, has the recording open and knows its times."""
    deadline = time.monotonic() + timeout
    reason = "it does not answer"
    while time.monotonic() < deadline and process.poll() is None:
        try:
            client = ViewerClient.connect(f"rerun+http://{LOOPBACK}:{port}/proxy")
            if client.get_state().active_recording is not None:
                client.set_time("sim_time", play_state="paused")  # refused for as long as it has read no times
                return client
            reason = "it does not load the file"
        except (ConnectionError, RuntimeError, OSError) as error:
            reason = str(error).partition("\n")[0]
        time.sleep(0.1)  # the viewer cannot be waited for, only asked
    if process.poll() is not None:
        raise ReplayError(
            f"the viewer ended with code {process.returncode}: is there a Vulkan driver (mesa-vulkan-drivers)?"
        )
    raise ReplayError(f"the viewer did not come up within {timeout:g} s: {reason}")


def _settle(client: ViewerClient, path: Path, timeout: float) -> None:
    """Take pictures until two in a row are the same: then everything is loaded."""
    deadline = time.monotonic() + timeout
    previous = b""
    while time.monotonic() < deadline:
        picture = client.take_screenshot()
        if picture == previous:
            path.write_bytes(picture)
            return
        previous = picture
        time.sleep(0.3)  # it does not say when it has loaded everything either
    raise ReplayError(f"the viewer was still changing after {timeout:g} s")
