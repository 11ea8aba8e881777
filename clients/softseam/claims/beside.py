"""The sibling's run in a process of its own, beside the run that it belongs to: the scene goes to the process, and what
it found comes back, after an empty line as it is set up."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Callable
from time import process_time
from typing import Any, BinaryIO

from softseam.child import Child, answers
from softseam.embedded import EmbeddedBackend, compile_clock
from softseam.errors import SoftseamError
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

    def __enter__(self) -> Beside:
        self.child = Child(__spec__.name, (), self._read)
        return self

    def __exit__(self, *_: object) -> None:
        self.child.close()

    def begin(self, bundle: Bundle) -> None:
        """Have this scene run."""
        data = encode(bundle)
        self.child.write(len(data).to_bytes(8, "big") + data)

    def begun(self, seconds: float) -> bool:
        """Whether it is set up, or has ended, waiting for that no longer than this [s]."""
        return self._begun.wait(seconds)

    def ended(self, seconds: float) -> bool:
        """Whether it has, waiting for that no longer than this [s]."""
        self.child.reader.join(seconds)
        return not self.child.reader.is_alive()

    def result(self) -> dict[str, Any]:
        """What `followed` found, once it has ended. Raises Lost."""
        code = self.child.process.wait()
        if code < 0:
            raise Lost(f"its process was ended by {signal.Signals(-code).name}")
        try:
            found: dict[str, Any] = json.loads(self._answer)
        except ValueError:
            raise Lost(f"its process exited with code {code}") from None
        if "error" in found:
            raise Lost(str(found["error"]))
        return found

    def _read(self, answers: BinaryIO) -> None:
        first = answers.read(1)
        self._begun.set()
        self._answer = first + answers.read()


def reported(session: Session) -> dict[str, Any]:
    """Run a session that was just reset to its end: its report."""
    builder = ReportBuilder(session.bundle)
    session.run(builder.see)
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
    source, out = sys.stdin.buffer, answers()
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
