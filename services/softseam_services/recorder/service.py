"""The recorder's process: writes sessions that ask for it to files, one file a run, and says what is safe.

An orchestrator asks with Begin; the answer comes once the session's topics are listened to. Then `Recorded` is
published a few times a second, so that the orchestrator can wait for a recorder that lags behind. End is answered when
the file is finished.
"""

import logging
import threading
from pathlib import Path

from softseam_protocol.bus.client import Bus
from softseam_protocol.errors import Refused
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Commit, Failure
from softseam_protocol.messages.recording import FINISH, Begin, End, Recorded
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode, encode
from softseam_services.bus_options import BusOptions, new_instance
from softseam_services.lifeline import Lifeline
from softseam_services.progress import tell_progress
from softseam_services.recorder.taping import Taping
from softseam_services.recorder.whole_file import RecordError

ROLE = SERVICE = "recorder"
_DRAIN = FINISH / 2.0
"""longest wait for messages that are still on their way when a session ends [s]"""
_log = logging.getLogger(__name__)


class RecorderHandler:
    """Bytes in, bytes out; owns the sessions that are being recorded."""

    def __init__(self, bus: Bus, keys: Keys, directory: Path) -> None:
        self._bus, self._keys, self._directory = bus, keys, directory
        self._tapings: dict[str, Taping] = {}
        self._finished: dict[str, Recorded] = {}
        self._lock = threading.Lock()

    def __call__(self, payload: bytes) -> bytes:
        """The reply. Raises Refused, DecodeError or SchemaMismatch."""
        request = decode(payload, Begin | End | Commit)
        session = request.header.session
        if not session:
            raise Refused(Failure(FailureKind.INVALID, "a recording needs the name of a session"))
        with self._lock:
            if isinstance(request, Begin):
                return encode(self._begin(session, request))
            if isinstance(request, End):
                return encode(self._end(session, request.reason))
            assert isinstance(request, Commit)
            return encode(self._taping(session).settle(_DRAIN))

    def _begin(self, session: str, begin: Begin) -> Recorded:
        known = self._tapings.get(session)
        if known is not None and known.begin == begin.header and known.messages == 0:
            return known.progress()  # the same request again
        if known is not None:
            self._end(session, "it goes on in another file" if begin.header.step else "begun anew", 0.0)
        orchestrators = self._bus.live(self._keys.every_live("orchestrator"))
        for other, taping in list(self._tapings.items()):
            its = taping.orchestrators  # none where this process had just joined
            if its and orchestrators and not its & orchestrators:
                self._end(other, "its orchestrator is gone", 0.0)
        try:
            taping = Taping(self._bus, self._keys, self._directory, session, begin, frozenset(orchestrators))
        except RecordError as error:
            raise Refused(Failure(FailureKind.DISK, str(error))) from None
        self._tapings[session] = taping
        self._finished.pop(session, None)
        _log.info("recording session %s to %s", session, taping.path)
        return taping.progress()

    def _end(self, session: str, reason: str, wait: float = _DRAIN) -> Recorded:
        if session not in self._tapings and session in self._finished:
            return self._finished[session]
        recorded = self._taping(session).finish(wait, f"was cut off: {reason}")
        del self._tapings[session]
        self._finished[session] = recorded
        _log.info(
            "%s: %d messages, %d lost; %s (%s)",
            recorded.path,
            recorded.messages,
            recorded.lost,
            recorded.note or recorded.state,
            reason,
        )
        return recorded

    def _taping(self, session: str) -> Taping:
        taping = self._tapings.get(session)
        if taping is None:
            raise Refused(
                Failure(FailureKind.NOT_CONFIGURED, f"session {session!r} is not being recorded: send Begin first")
            )
        return taping

    def close(self) -> None:
        """Finish all files."""
        with self._lock:
            for session in list(self._tapings):
                self._end(session, "the recorder stops", 0.5)

    def last(self) -> tuple[str, int]:
        """Session and step of the last message recorded."""
        for session, taping in list(self._tapings.items()):
            return session, taping.step
        return "", 0


def serve_recorder(directory: Path, options: BusOptions, life: Lifeline) -> None:
    """Record into `directory` until the process is asked to stop; then finish all files. Raises RecordError."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordError(f"cannot record into {directory}: {error.strerror or error}") from error
    keys, instance = options.keys, new_instance()
    with options.open() as bus:
        handler = RecorderHandler(bus, keys, directory)
        server = bus.serve({keys.recorder: handler}, name="softseam recorder")
        tell_progress(life, bus, keys, server, ROLE, SERVICE, instance, handler.last)
        life.when_stopping(server.close)
        bus.declare_live(keys.live(ROLE, SERVICE, instance))
        life.state = "ready"
        try:
            server.run()
        finally:
            handler.close()
