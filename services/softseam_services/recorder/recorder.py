"""Records messages from the process that makes them, without ever holding it up.

`write` encodes at once, so the caller may reuse its arrays, and leaves compression and the disk to a thread. It waits
at most `patience` seconds for room in the queue; then messages are dropped and counted until the queue has drained.
A disk that fails, is about to be full, or a recording that is too large ends the recording, not the run: the file is
closed readable and the rest counts as lost.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

from softseam_protocol.messages.outcomes import RecordingState
from softseam_protocol.messages.recording import Begin, Recorded
from softseam_protocol.messages.session import Event, Frame, StepReport
from softseam_protocol.wire import codec
from softseam_services.recorder.log_file import LogFile
from softseam_services.recorder.room import check_room
from softseam_services.recorder.whole_file import Existing

FLUSH_PERIOD = 0.2
"""age of the oldest unflushed message when it is flushed [s]; a killed recorder loses this and the flush itself"""
WAKE = 1 << 19
"""queued bytes that wake the writing thread before its time: it does not disturb the simulation in every step"""

Recordable = StepReport | Frame | Event


class McapRecorder:
    """Writes one session to one file on a thread of its own; a context manager."""

    def __init__(
        self,
        path: Path | str,
        begin: Begin,
        *,
        existing: Existing = "error",
        queue_bytes: int = 64 << 20,
        patience: float = 0.05,
        on_loss: Callable[[str], None] | None = None,
    ) -> None:
        """Create the file; raises RecordError where that fails.

        queue_bytes  encoded messages that may wait for the disk [B]
        patience     longest wait of a `write` for room in the queue [s]
        on_loss      hears once, on the writing thread or the caller's, why messages begin to be lost
        """
        self._file = LogFile(Path(path), begin, existing=existing)
        self._header = begin.header
        self._queue: deque[tuple[type, float, bytes, int]] = deque()
        self._queued = 0  # bytes
        self._limit, self._patience, self._on_loss = queue_bytes, patience, on_loss
        self._wake = min(WAKE, queue_bytes // 2)
        self._accepted = self._safe = self._dropped = 0  # messages
        self._stalled = self._closing = False
        self._due = 0.0  # time.monotonic() of the next flush
        self._end = self._why = ""
        self.failure: str | None = None
        """why messages were lost, or None"""
        self.seconds = 0.0
        """wall time that `write` took from its callers [s]"""
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._work, name="softseam recorder", daemon=True)
        self._thread.start()

    @property
    def path(self) -> Path:
        return self._file.path

    @property
    def lost(self) -> int:
        """Messages that are not and will not be in the file."""
        return self._dropped + (self._accepted - self._safe if self._end else 0)

    def write(self, message: Recordable) -> None:
        """Record a message; never raises for the disk's sake, never waits longer than `patience`."""
        began = time.perf_counter()
        self.write_encoded(type(message), message.header.time, codec.encode(message))
        self.seconds += time.perf_counter() - began

    def write_encoded(self, kind: type, sim_time: float, data: bytes) -> None:
        """Record a message of type `kind` that is encoded already."""
        now = time.time_ns()
        with self._changed:
            if not self._end and not self._closing and self._has_room(len(data)):
                self._queue.append((kind, sim_time, data, now))
                self._queued += len(data)
                self._accepted += 1
                if len(self._queue) == 1 or self._queued >= self._wake:
                    self._changed.notify_all()
                return
            self._dropped += 1
        if not self._end:
            self._tell("the disk is too slow: messages are dropped until it catches up")

    def progress(self) -> Recorded:
        """What is in the file by now."""
        state = RecordingState.CLOSED if self._end == "closed" else RecordingState.FAILED
        if not self._end:
            state = RecordingState.RECORDING
        note = self.failure or ("" if self._end in ("", "closed") else f"the recording {self._end}")
        return Recorded(self._header, str(self.path), self._safe, self.lost, self._file.size, state, note)

    def close(self, timeout: float = 30.0, why: str = "") -> Recorded:
        """Write what is queued, finish the file, and say what became of it.

        why  what the recording lacks, where it ends before its run; completes "run.mcap ..."
        """
        with self._changed:
            self._closing, self._why = True, why
            self._changed.notify_all()
        self._thread.join(timeout)
        if self._thread.is_alive():
            self._end = "abandoned"
            self._tell(f"the disk did not take the rest within {timeout:g} s")
        return self.progress()

    def __enter__(self) -> McapRecorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _has_room(self, size: int) -> bool:
        """Whether the queue takes `size` bytes more, after a short wait the first time it is full (lock held)."""

        def room() -> bool:
            return not self._queue or self._queued + size <= self._limit

        if not room() and not self._stalled:
            self._changed.wait_for(room, self._patience)
            # one wait a stall: a slow disk costs the simulation `patience` once, not in every step
            self._stalled = not room()
        return room()

    def _tell(self, reason: str) -> None:
        if self.failure is None:
            self.failure = reason
            if self._on_loss is not None:
                self._on_loss(reason)

    def _work(self) -> None:
        """The thread: append what is queued, flush every FLUSH_PERIOD, close at the end."""
        try:
            while self._append_batch():
                pass
            dropped = f"lacks {self._dropped} messages, for which the disk was too slow" if self._dropped else ""
            self._file.close(self._why or dropped)
            self._safe = self._accepted
            self._end = "closed"
        except OSError as error:
            self._end = "failed"
            self._tell(f"{self.path}: {error.strerror or error}: the recording ends here, the run goes on")
            self._close_broken(f"was cut off: {error.strerror or error}")

    def _append_batch(self) -> bool:
        """Wait for enough messages or the next flush; False when everything is written and the file can be closed."""
        with self._changed:
            if self._safe == self._accepted:
                self._changed.wait_for(lambda: bool(self._queue) or self._closing)
                self._due = time.monotonic() + FLUSH_PERIOD
            self._changed.wait_for(
                lambda: self._closing or self._queued >= self._wake, max(0.0, self._due - time.monotonic())
            )
            batch, self._queue = self._queue, deque()
            self._queued = 0
            self._stalled = False
            closing, accepted = self._closing, self._accepted
            self._changed.notify_all()
        for kind, sim_time, data, wall_ns in batch:
            self._file.add(kind, sim_time, data, wall_ns)
        if closing or time.monotonic() >= self._due:
            self._file.flush()
            self._safe, self._due = accepted, time.monotonic() + FLUSH_PERIOD
            if not closing:
                check_room(self.path, self._file.size)
        return not closing

    def _close_broken(self, why: str) -> None:
        try:
            self._file.close(why)
        except OSError:
            return  # the file ends in the tail of its last flush, which says that its recorder did not finish
