"""Rerun's viewer as a process: without its usage reporting, and ended with the one that started it."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import rerun_cli

REPORTING = "SOFTSEAM_RERUN_ANALYTICS"
"""environment variable; where it is 1 the viewer reports its usage as `rerun analytics` set it"""
_GRACE = 5.0
"""time that a viewer gets to end by itself [s]"""


def viewer() -> str:
    """The viewer that comes with rerun-sdk: this one, whatever else is on the path."""
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    return str(Path(rerun_cli.__file__).parent / name)


@contextmanager
def running(arguments: Sequence[str], silent: bool = False) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer with these arguments, which ends with the block, whatever ends that: SIGTERM, too.

    silent: what it prints is dropped
    """
    output = subprocess.DEVNULL if silent else None
    with tempfile.TemporaryDirectory(prefix="softseam-") as folder, _ending_by_sigterm():
        process = subprocess.Popen([viewer(), *arguments], stdout=output, stderr=output, env=quiet(Path(folder)))
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(timeout=_GRACE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def quiet(folder: Path) -> dict[str, str]:
    """The environment of a viewer that reports no usage: its settings are in a folder, which is written.

    Rerun reports usage from its second start on, unless `rerun analytics disable` was run. It looks for that where
    XDG_CONFIG_HOME says, on Linux.
    """
    if os.environ.get(REPORTING) == "1":
        return dict(os.environ)
    own = folder / "rerun"
    own.mkdir(parents=True)
    places = {"config_file_path": str(own / "analytics.json"), "data_dir_path": str(own)}
    settings = {"analytics_enabled": False, "analytics_id": "", "metadata": {}, **places}
    (own / "analytics.json").write_text(json.dumps(settings))
    return {**os.environ, "XDG_CONFIG_HOME": str(folder)}


@contextmanager
def _ending_by_sigterm() -> Iterator[None]:
    """SIGTERM ends what is at work as an exception does, so that nothing is left behind; in the main thread alone."""

    def end(number: int, _: object) -> NoReturn:
        raise SystemExit(128 + number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
