"""One session being recorded: from the bus's inbox to the file, on a thread of its own."""

import threading
import time
from pathlib import Path

from softseam_protocol.bus.client import Bus
from softseam_protocol.errors import ProtocolError
from softseam_protocol.messages.recording import FINISH, Begin, End, Recorded
from softseam_protocol.messages.session import Event, Frame, StepReport
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode, encode
from softseam_services.recorder.recorder import McapRecorder

_TELL = 0.1
"""time between looks at what to report [s]"""
_CLOSE = FINISH / 2.0
"""longest wait for the disk when a file is finished [s]"""
_PATIENCE = 5.0
"""wait for a slow disk before messages are dropped [s]; meanwhile they pile up in the inbox, not in the simulation"""

Taped = StepReport | Frame | Event | End


class Taping:
    """Listens from the moment it is built. Raises RecordError where the file cannot be created."""

    def __init__(
        self, bus: Bus, keys: Keys, directory: Path, session: str, begin: Begin, orchestrators: frozenset[str]
    ) -> None:
        self.begin = begin.header
        self.orchestrators = orchestrators
        """tokens of the orchestrators that lived when the session began, its own among them"""
        self.step = 0
        """step of the last message"""
        self._bus, self._key = bus, keys.session(session, Recorded)
        path = directory / f"{session}.mcap"
        self._recorder = McapRecorder(path, begin, existing="number", patience=_PATIENCE)
        self._due = 0.0
        self._refused = 0
        self._told: Recorded | None = None
        self._ended = threading.Event()
        self._stop = threading.Event()
        self._arrived = 0
        topics: tuple[type[Taped], ...] = (StepReport, Frame, Event, End)
        self._inbox = bus.subscribe(keys.session_all(session))
        self._wanted: dict[str, type[Taped]] = {keys.session(session, topic): topic for topic in topics}
        self._thread = threading.Thread(target=self._listen, name=f"recording {session}", daemon=True)
        self._thread.start()

    @property
    def path(self) -> Path:
        return self._recorder.path

    @property
    def messages(self) -> int:
        """Messages that came so far."""
        return self._arrived

    def progress(self) -> Recorded:
        """What is in the file, and what is lost on whatever way."""
        found = self._recorder.progress()
        lost = found.lost + self._refused + self._inbox.lost
        return Recorded(found.header, found.path, found.messages, lost, found.bytes, found.state, found.note)

    def settle(self, timeout: float) -> Recorded:
        """Wait until everything that has come is in the file or lost."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            found = self.progress()
            if len(self._inbox) == 0 and found.messages + found.lost >= self._arrived:
                break
            self._stop.wait(0.02)
        return self.progress()

    def finish(self, timeout: float, why: str) -> Recorded:
        """Wait for the session's published End, which comes after all its messages; then finish the file.

        why  the file ends where that End does not come; completes "run.mcap ..."
        """
        self._ended.wait(timeout)
        self._inbox.close()
        self._stop.set()
        self._thread.join(_CLOSE)
        self._recorder.close(_CLOSE, "" if self._ended.is_set() else why)
        self._tell()
        return self.progress()

    def _listen(self) -> None:
        while not (self._stop.is_set() and len(self._inbox) == 0):
            received = self._inbox.get(_TELL)
            kind = None if received is None else self._wanted.get(received.key)
            if received is not None and kind is not None:
                self._take(kind, received.payload)
            self._tell_if_due()

    def _take(self, kind: type[Taped], payload: bytes) -> None:
        try:
            message = decode(payload, kind)
        except ProtocolError:
            # malformed or foreign: counted, and nothing else
            self._arrived += 1
            self._refused += 1
            return
        if isinstance(message, End):
            self._ended.set()
            return
        self._arrived += 1
        self.step = message.header.step
        self._recorder.write_encoded(kind, message.header.time, payload)

    def _tell_if_due(self) -> None:
        """Publish progress when there is some, or a loss."""
        now = time.monotonic()
        if now < self._due:
            return
        self._due = now + _TELL
        if self.progress() != self._told:
            self._tell()

    def _tell(self) -> None:
        self._told = self.progress()
        try:
            self._bus.publish(self._key, encode(self._told), droppable=True)
        except ProtocolError:
            return  # the bus is gone; the file is what counts
