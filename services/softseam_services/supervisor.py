"""Keeps services running: starts them in order, restarts what dies, kills and restarts what freezes, stops all.

Every child sends its state on a pipe (see `lifeline`). A child that exits is restarted after a growing pause; one that
has been silent for `patience` (a frozen process), or busy with one request for `stall`, is killed first. A child that
exits with 2 was set up wrongly: restarting would not help, so the supervisor stops everything and says why.
"""

from __future__ import annotations

import os
import selectors
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType

from softseam_services.child import Child, Service, ending
from softseam_services.lifeline import STOPPING, heard_elsewhere

WRONG_SET_UP = 2
"""exit code of a service that no restart would help"""
_TICK = 0.1
_STARTING = 30.0
"""silence that a child is allowed until it is ready: an interpreter that starts, or a compiler that lets no thread
run, on a busy machine [s]"""
_GOOD_RUN = 20.0
"""a child that lived this long starts its count of failures anew [s]"""


@dataclass(frozen=True)
class Limits:
    """When a child counts as dead, frozen or stuck [s]."""

    patience: float = 3.0
    stall: float = 180.0
    pause: float = 0.25
    """before the second restart in a row; doubles with each further one"""
    longest_pause: float = 5.0
    attempts: int = 10
    """failures in a row before giving up"""


class Supervisor:
    """Owns the children of one machine. One thread runs the loop; a context manager starts and stops it."""

    def __init__(
        self, services: Sequence[Service], report: Callable[[str], None], limits: Limits | None = None
    ) -> None:
        self._children = {service.name: Child(service) for service in services}
        self._report = report
        self._limits = limits or Limits()
        self._selector = selectors.DefaultSelector()
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        os.set_blocking(self._wake_write, False)
        self._selector.register(self._wake_read, selectors.EVENT_READ, None)
        self._changed = threading.Condition()
        self._stopping = False
        self._router_was_ready = False
        self._thread = threading.Thread(target=self._run, name="softseam supervisor", daemon=True)
        self.failure = ""
        """why it gave up, or empty"""
        self.exit_code = 0

    def __enter__(self) -> Supervisor:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def stop(self) -> None:
        """Stop all children, the last started first, and wait for them (bounded by their graces)."""
        self.request_stop()
        self._thread.join()

    def request_stop(self) -> None:
        """Begin to stop; returns at once, may be called from a signal handler."""
        self._stopping = True
        try:
            os.write(self._wake_write, bytes([signal.SIGTERM]))
        except OSError:
            return  # the loop has ended, or is awake anyway

    @contextmanager
    def stopped_by_signals(self) -> Iterator[None]:
        """SIGTERM and SIGINT (Ctrl-C) begin to stop the children; call from the main thread."""
        # the number of a signal is written to the loop's pipe at once, whatever the main thread waits for
        before = {number: signal.signal(number, heard_elsewhere) for number in STOPPING}
        waker = signal.set_wakeup_fd(self._wake_write, warn_on_full_buffer=False)
        try:
            yield
        finally:
            signal.set_wakeup_fd(waker)
            for number, handler in before.items():
                signal.signal(number, handler)

    @property
    def stopping(self) -> bool:
        """Whether it stops, or has stopped."""
        return self._stopping

    def wait_ready(self, timeout: float, names: Sequence[str] | None = None) -> bool:
        """Whether all children (or those named) are ready within `timeout` [s]; False too where it gave up."""
        wanted = [self._children[name] for name in names or self._children]

        def settled() -> bool:
            return self._stopping or all(child.state == "ready" for child in wanted)

        with self._changed:
            return self._changed.wait_for(settled, timeout) and not self._stopping

    def wait_stopped(self, timeout: float | None = None) -> bool:
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def pid(self, name: str) -> int:
        """Process id of a child; 0 where it is down."""
        process = self._children[name].process
        return process.pid if process is not None else 0

    def state(self, name: str) -> str:
        """'down', 'starting', 'compiling', 'ready' or 'stopping'."""
        return self._children[name].state

    # ---- the loop, in its own thread ---------------------------------------------------------------------

    def _run(self) -> None:
        try:
            last = time.monotonic()
            while not self._stopping:
                for key, _ in self._selector.select(_TICK):
                    self._read(key)
                now = time.monotonic()
                if now - last > 1.0:  # this process itself was held up: nobody is to blame for silence
                    for child in self._children.values():
                        child.heard += now - last
                last = now
                self._start_due(now)
                for child in self._children.values():
                    self._look_after(child, now)
            self._stop_all()
        finally:
            for child in self._children.values():
                if child.process is not None and child.process.poll() is None:
                    child.process.kill()
                    child.process.wait()
            self._selector.close()
            os.close(self._wake_read)
            os.close(self._wake_write)
            with self._changed:
                self._stopping = True
                self._changed.notify_all()

    def _start_due(self, now: float) -> None:
        """Start what is due. Children after the first (the router) wait until it has been ready once."""
        for child in self._children.values():
            if child.process is None and child.start_at is not None and now >= child.start_at:
                self._start(child, now)
            if not self._router_was_ready:
                return

    def _start(self, child: Child, now: float) -> None:
        child.start(self._selector, now)
        self._enter(child, "starting")

    def _read(self, key: selectors.SelectorKey) -> None:
        if key.data is None:
            if not STOPPING.isdisjoint(os.read(self._wake_read, 4096)):
                self._stopping = True
            return
        self._told(key.data, key.data.drain(self._selector, key.fd, self._report))

    def _told(self, child: Child, states: list[str]) -> None:
        for state in states:
            if state != child.state:
                self._enter(child, state)

    def _enter(self, child: Child, state: str) -> None:
        name, now = child.service.name, time.monotonic()
        if state == "ready":
            assert child.process is not None
            self._router_was_ready = True  # nothing else runs before
            self._report(f"{name} is ready (pid {child.process.pid}, {now - child.born:.1f} s)")
        with self._changed:
            child.state = state
            self._changed.notify_all()

    def _look_after(self, child: Child, now: float) -> None:
        process = child.process
        if process is None:
            return
        code = process.poll()
        if code is not None:
            self._ended(child, code, now)
        elif not child.why:
            patience = _STARTING if child.state in ("starting", "compiling") else self._limits.patience
            if now - child.heard > patience:
                child.why = f"gave no sign of life for {now - child.heard:.1f} s"
            elif child.busy > self._limits.stall:
                child.why = f"was busy with one request for {child.busy:.0f} s"
            if child.why:
                process.kill()

    def _ended(self, child: Child, code: int, now: float) -> None:
        """A child has exited: say so, and plan its restart."""
        name = child.service.name
        self._forget(child)
        if code == WRONG_SET_UP:
            said = next((line for line in reversed(child.tail) if line), "it did not say why")
            self._give_up(f"{name} cannot run: {said}", WRONG_SET_UP)
            return
        child.failures = 1 if now - child.born > _GOOD_RUN else child.failures + 1
        if child.failures > self._limits.attempts:
            self._give_up(f"{name} failed {child.failures} times in a row", 1)
            return
        pause = 0.0
        if child.failures > 1:
            pause = min(self._limits.longest_pause, self._limits.pause * 2.0 ** (child.failures - 2))
        child.start_at = now + pause
        how = child.why or ending(code)
        self._report(f"{name} {how}: restarting" + (f" in {pause:g} s" if pause else ""))

    def _give_up(self, why: str, code: int) -> None:
        self.failure, self.exit_code, self._stopping = why, code, True

    def _forget(self, child: Child) -> None:
        self._told(child, child.rest(self._selector, self._report))
        child.close()
        self._enter(child, "down")

    def _stop_all(self) -> None:
        """SIGTERM, the last started first; SIGKILL for those that outstay their grace."""
        for child in reversed(self._children.values()):
            process = child.process
            if process is None:
                continue
            process.send_signal(signal.SIGTERM)
            deadline = time.monotonic() + child.service.grace
            while process.poll() is None and time.monotonic() < deadline:
                for key, _ in self._selector.select(0.05):
                    self._read(key)
            if process.poll() is None:
                self._report(f"{child.service.name} did not stop within {child.service.grace:g} s: killed")
                process.kill()
                process.wait()
            self._forget(child)
