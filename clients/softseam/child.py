"""A process of Python beside this one: work goes in through a pipe, answers come back. It ends as its input does, so
that it ends with the one that started it, whatever ends that."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from typing import BinaryIO, TextIO, cast


class Child:
    """Runs a module, whose answers `read` reads in a thread of its own; its messages for people go nowhere."""

    def __init__(self, module: str, arguments: Sequence[str], read: Callable[[BinaryIO], None]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C reaches this process alone, which ends that one
        )
        self._in, self._out = cast(BinaryIO, self.process.stdin), cast(BinaryIO, self.process.stdout)
        self.reader = threading.Thread(target=read, args=(self._out,), name=f"answers of {module}", daemon=True)
        self.reader.start()
        self._writer: threading.Thread | None = None

    def write(self, data: bytes) -> None:
        """Send work; what the pipe does not hold waits until the process has loaded what it needs."""
        self._writer = threading.Thread(target=self._write, args=(data,), daemon=True)
        self._writer.start()

    def close(self) -> None:
        """End it, whatever it does."""
        self.process.kill()
        self.process.wait()
        self.reader.join()
        if self._writer is not None:
            self._writer.join()
        try:
            self._in.close()
        except BrokenPipeError:
            pass  # it ended before it had read all
        self._out.close()

    def _write(self, data: bytes) -> None:
        try:
            self._in.write(data)
            self._in.flush()
        except BrokenPipeError:
            pass  # how it ended, its exit code says


def answers() -> TextIO:
    """In such a process: what its answers are written to; whatever else is printed is none."""
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    return out
