"""The supervisor restarts what dies, kills what freezes or hangs, and gives up only where a restart would not help."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import pytest

from softseam_services.child import Service
from softseam_services.supervisor import Limits, Supervisor

QUICK = Limits(patience=1.5, stall=1.0, pause=0.05, longest_pause=0.2, attempts=3)
WAIT = 30.0

STARTS_DEAF = """
import ctypes
from softseam_services.lifeline import Lifeline
with Lifeline() as life:
    life.state = "compiling"
    ctypes.PyDLL(None).usleep(1_900_000)  # holds the interpreter's lock, as parts of a compilation do
    life.state = "ready"
    life.stop.wait()
"""
WELL = """
from softseam_services.lifeline import Lifeline
with Lifeline() as life:
    life.state = "ready"
    life.stop.wait()
"""
HANGS_ONCE_STARTED = """
import time
from softseam_services.lifeline import Lifeline
began = time.monotonic()
with Lifeline() as life:
    life.busy_of = lambda: time.monotonic() - began
    life.state = "ready"
    life.stop.wait()
"""
COMPILES_LONG = """
import time
from softseam_services.lifeline import Lifeline
with Lifeline("compiling") as life:
    end = time.monotonic() + 3.0
    while time.monotonic() < end:
        sum(range(10000))
    life.state = "ready"
    life.stop.wait()
"""
DEAF = """
import signal
from softseam_services.lifeline import Lifeline
with Lifeline(signals=False) as life:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    life.state = "ready"
    life.stop.wait()
"""


def python(name: str, code: str, grace: float = 5.0) -> Service:
    return Service(name, (sys.executable, "-c", code), grace)


class Lines:
    """What the supervisor reports, to wait for."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._changed = threading.Condition()

    def __call__(self, line: str) -> None:
        with self._changed:
            self.lines.append(line)
            self._changed.notify_all()

    def wait_for(self, *words: str) -> str:
        def found() -> str:
            return next((line for line in self.lines if all(word in line for word in words)), "")

        with self._changed:
            assert self._changed.wait_for(found, WAIT), f"no line with {words} in {self.lines}"
            return found()


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def wait_until(condition: Callable[[], bool], why: str) -> None:
    """Poll what nothing announces: another process's end."""
    end = time.monotonic() + WAIT
    while not condition():
        assert time.monotonic() < end, why
        threading.Event().wait(0.02)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "frozen"])
def test_a_lost_child_is_replaced(number: signal.Signals) -> None:
    lines = Lines()
    with Supervisor([python("one", WELL), python("two", WELL)], lines, QUICK) as supervisor:
        assert supervisor.wait_ready(WAIT), lines.lines
        first, other = supervisor.pid("two"), supervisor.pid("one")
        os.kill(first, number)
        lines.wait_for("two", "no sign of life" if number == signal.SIGSTOP else "SIGKILL", "restarting")
        wait_until(lambda: supervisor.pid("two") not in (0, first), "no new process")
        assert supervisor.wait_ready(WAIT), lines.lines
        assert supervisor.pid("one") == other  # the other one never noticed
        assert not is_running(first)
        pids = [supervisor.pid("one"), supervisor.pid("two")]
    assert not any(is_running(pid) for pid in pids)


def test_a_request_without_end_is_ended() -> None:
    lines = Lines()
    with Supervisor([python("one", HANGS_ONCE_STARTED)], lines, QUICK):
        lines.wait_for("one", "busy with one request", "restarting")


@pytest.mark.parametrize("code", [COMPILES_LONG, STARTS_DEAF])
def test_a_long_compilation_is_not_taken_for_a_freeze(code: str) -> None:
    lines = Lines()
    with Supervisor([python("one", code)], lines, QUICK) as supervisor:
        assert supervisor.wait_ready(WAIT), lines.lines
    assert not any("restarting" in line for line in lines.lines), lines.lines


def test_a_wrong_set_up_stops_everything_and_says_why() -> None:
    lines = Lines()
    wrong = python("two", "import sys; print('the port 7 is in use'); sys.exit(2)")
    with Supervisor([python("one", WELL), wrong], lines, QUICK) as supervisor:
        assert not supervisor.wait_ready(WAIT)
        assert supervisor.wait_stopped(WAIT)
    assert supervisor.failure == "two cannot run: the port 7 is in use"
    assert supervisor.exit_code == 2


def test_a_child_that_always_dies_is_given_up() -> None:
    lines = Lines()
    with Supervisor([python("one", "raise SystemExit(5)")], lines, QUICK) as supervisor:
        assert supervisor.wait_stopped(WAIT)
    assert supervisor.exit_code == 1 and "failed 4 times in a row" in supervisor.failure
    assert sum("exited with code 5" in line for line in lines.lines) == QUICK.attempts


def test_a_deaf_child_is_killed_at_the_end_of_its_grace() -> None:
    lines = Lines()
    with Supervisor([python("one", DEAF, grace=0.3)], lines, QUICK) as supervisor:
        assert supervisor.wait_ready(WAIT), lines.lines
        pid = supervisor.pid("one")
    assert not is_running(pid)
    lines.wait_for("one", "did not stop within 0.3 s")


def test_a_child_that_has_just_become_ready_hears_that_it_shall_stop() -> None:
    """The signal may come while its main thread goes to sleep: it must not be missed."""
    lines = Lines()
    for _ in range(15):
        with Supervisor([python("one", WELL)], lines, QUICK) as supervisor:
            assert supervisor.wait_ready(WAIT), lines.lines
    assert not any("did not stop" in line for line in lines.lines), lines.lines


def test_children_do_not_outlive_their_supervisor() -> None:
    """A supervisor that is killed takes its children along: they see the pipe close."""
    code = f"""
import sys, threading
from softseam_services.child import Service
from softseam_services.supervisor import Supervisor
def report(line):
    print(line, flush=True)
with Supervisor([Service("one", (sys.executable, "-c", {WELL!r}))], report):
    threading.Event().wait()
"""
    with subprocess.Popen((sys.executable, "-c", code), stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert "one is ready (pid " in line
        pid = int(line.split("pid ")[1].split(",")[0])
        assert is_running(pid)
        process.kill()
    wait_until(lambda: not is_running(pid), "the child runs on")
