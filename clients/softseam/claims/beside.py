"""The sibling's run in a process of its own, beside the run that it belongs to.

Two pipes join them: the scene goes to the process, and what it found comes back, after an empty line as it is set up.
The process ends as its input does, so that it ends with the one that started it, whatever ends that.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from time import process_time
from typing import Any, BinaryIO

from softseam.embedded import EmbeddedBackend, compile_clock
from softseam.errors import SoftseamError
from softseam.observation import Observation
from softseam.report import ReportBuilder
from softseam.session import Session
from softseam_protocol.extensions import load_extensions
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.file import scene_from_bundle
from softseam_protocol.wire.codec import decode, encode


class Lost(Exception):
    """Why a sibling's run found nothing, for people."""


class Beside:
    """A context around a run: a process that loads the solvers at once, and runs a scene when it is given one."""

    def __init__(self) -> None:
        self._answer = b""
        self._begun = threading.Event()
        self._writer: threading.Thread | None = None

    def __enter__(self) -> Beside:
        self.process = subprocess.Popen(
            [sys.executable, "-m", __spec__.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C reaches the run alone, which ends it
        )
        self._reader = threading.Thread(target=self._read, name="softseam sibling", daemon=True)
        self._reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join()
        if self._writer is not None:
            self._writer.join()
        assert self.process.stdin is not None and self.process.stdout is not None
        try:
            self.process.stdin.close()
        except BrokenPipeError:
            pass  # it ended before it had read all
        self.process.stdout.close()

    def begin(self, bundle: Bundle) -> None:
        """Have this scene run."""
        self._writer = threading.Thread(target=self._write, args=(encode(bundle),), daemon=True)
        self._writer.start()  # what the pipe does not hold waits until the process has loaded the solvers

    def begun(self, seconds: float) -> bool:
        """Whether it is set up, or has ended, waiting for that no longer than this [s]."""
        return self._begun.wait(seconds)

    def ended(self, seconds: float) -> bool:
        """Whether it has, waiting for that no longer than this [s]."""
        self._reader.join(seconds)
        return not self._reader.is_alive()

    def result(self) -> dict[str, Any]:
        """What `followed` found, once it has ended. Raises Lost."""
        code = self.process.wait()
        if code < 0:
            raise Lost(f"its process was ended by {signal.Signals(-code).name}")
        try:
            found: dict[str, Any] = json.loads(self._answer)
        except ValueError:
            raise Lost(f"its process exited with code {code}") from None
        if "error" in found:
            raise Lost(str(found["error"]))
        return found

    def _write(self, data: bytes) -> None:
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(len(data).to_bytes(8, "big") + data)
            self.process.stdin.flush()
        except BrokenPipeError:
            pass  # `result` says how it ended

    def _read(self) -> None:
        assert self.process.stdout is not None
        first = self.process.stdout.read(1)
        self._begun.set()
        self._answer = first + self.process.stdout.read()


def reported(session: Session) -> dict[str, Any]:
    """Run a session that was just reset to its end: its report."""
    builder = ReportBuilder(session.bundle)

    def step(observation: Observation) -> None:
        for event in observation.events:
            builder.add(event)
        builder.add(observation.report)

    session.run(step)
    return builder.build()


def followed(session: Session) -> dict[str, Any]:
    """Of the same, `outcome`, `quantities` as in a report, and `seconds` of its steps."""
    report = reported(session)
    found = {"outcome": report["verdict"]["outcome"], "quantities": report["quantities"]}
    return found | {"seconds": report["wall"]["total"]}


def run_here(bundle: Bundle, begun: Callable[[], object] = lambda: None) -> dict[str, Any]:
    """The same of a scene in this process; `seconds` are its processors', without compiling.

    begun: called before the first step
    """
    with compile_clock() as compiled, Session(scene_from_bundle(bundle), bundle, EmbeddedBackend(bundle)) as session:
        session.reset()
        begun()
        began = process_time() - compiled()[1]
        found = followed(session)
        return found | {"seconds": process_time() - compiled()[1] - began}


def _end_with(source: BinaryIO) -> None:
    source.read(1)
    os._exit(1)


def main() -> None:
    """Read a scene, run it, and say what came of it."""
    source, out = sys.stdin.buffer, os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever else is printed is no answer
    load_extensions()
    with compile_clock():
        pass  # loads the solvers while the run is set up
    data = source.read(int.from_bytes(source.read(8), "big"))
    threading.Thread(target=_end_with, args=(source,), daemon=True).start()
    try:
        found = run_here(decode(data, Bundle), lambda: print(file=out, flush=True))
    except SoftseamError as error:
        found = {"error": str(error)}
    except Exception as error:
        found = {"error": f"{type(error).__name__}: {error}"}
    json.dump(found, out)
    out.close()
    os._exit(0)


if __name__ == "__main__":
    main()
