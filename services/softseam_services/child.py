"""One service as a child process: its pipes, what it says on them, how long it has been silent, and how it ended."""

import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from softseam_services.lifeline import BEAT_VARIABLE


@dataclass(frozen=True)
class Service:
    """One child process.

    grace    time it gets to finish after SIGTERM [s]
    """

    name: str
    argv: tuple[str, ...]
    grace: float = 5.0


@dataclass
class Child:
    """A service, its process if there is one, and what is known of it."""

    service: Service
    process: subprocess.Popen[bytes] | None = None
    beats: int = -1
    """read end of the lifeline"""
    log: int = -1
    """read end of stdout and stderr"""
    state: str = "down"
    heard: float = 0.0
    """last beat, or the deadline of the first one"""
    busy: float = 0.0
    born: float = 0.0
    start_at: float | None = 0.0
    """when to start it; None: not"""
    failures: int = 0
    partial: dict[int, bytes] = field(default_factory=dict)
    tail: deque[str] = field(default_factory=lambda: deque(maxlen=20))
    why: str = ""
    """why the supervisor killed it"""

    def start(self, selector: selectors.BaseSelector, now: float) -> None:
        """Start the process, and let the selector watch its pipes."""
        beats, beats_write = os.pipe()
        os.set_blocking(beats, False)
        self.process = subprocess.Popen(
            self.service.argv,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=(beats_write,),
            env=os.environ | {BEAT_VARIABLE: str(beats_write), "PYTHONUNBUFFERED": "1"},
            start_new_session=True,  # Ctrl-C reaches the supervisor alone, which stops the children in order
        )
        os.close(beats_write)
        assert self.process.stdout is not None
        self.beats, self.log = beats, self.process.stdout.fileno()
        os.set_blocking(self.log, False)
        selector.register(beats, selectors.EVENT_READ, self)
        selector.register(self.log, selectors.EVENT_READ, self)
        self.born = self.heard = now
        self.busy, self.start_at, self.why = 0.0, None, ""
        self.partial.clear()
        self.tail.clear()

    def drain(self, selector: selectors.BaseSelector, fd: int, say: Callable[[str], None]) -> list[str]:
        """Take what came on one of the pipes, unregistered at its end: log lines are said, beats returned as states."""
        try:
            data = os.read(fd, 1 << 16)
        except BlockingIOError:
            return []
        if not data:
            if fd in selector.get_map():
                selector.unregister(fd)
            return []
        *lines, rest = (self.partial.get(fd, b"") + data).split(b"\n")
        self.partial[fd] = rest[-4096:]
        states = []
        for line in lines:
            text = line.decode(errors="replace").rstrip()
            if fd == self.log:
                self.tail.append(text)
                if text:
                    say(f"[{self.service.name}] {text}")
            else:
                states.append(self._heard(text))
        return [state for state in states if state]

    def _heard(self, text: str) -> str:
        """A beat: the state it reports, '' of a line that was cut by the child's death."""
        try:
            beat = json.loads(text)
            state, busy = str(beat["state"]), float(beat["busy"])
        except (ValueError, KeyError, TypeError):
            return ""
        self.heard, self.busy = time.monotonic(), busy
        return state

    def rest(self, selector: selectors.BaseSelector, say: Callable[[str], None]) -> list[str]:
        """Read the rest of an ended process's pipes; returns the states that it reported there."""
        states = []
        for fd in (self.log, self.beats):
            while fd in selector.get_map():
                before = self.partial.get(fd)
                states += self.drain(selector, fd, say)
                if self.partial.get(fd) == before and fd in selector.get_map():
                    selector.unregister(fd)  # a grandchild holds it open
        return states

    def close(self) -> None:
        """There is no process any more."""
        assert self.process is not None and self.process.stdout is not None
        os.close(self.beats)
        self.process.stdout.close()
        self.process = None


def ending(code: int) -> str:
    """How a process with this exit code ended."""
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}"
    return f"exited with code {code}"


def service_argv(role: str, *options: str) -> tuple[str, ...]:
    """Command line of one service of this installation."""
    return (sys.executable, "-m", "softseam_services", "serve", role, *options)
